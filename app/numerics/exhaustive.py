"""
The definition: align the window with the fitted curves at every metre of every road, both ways.

Slow, and plainly right. `app.numerics.matching.locate` must return the same.
"""

from __future__ import annotations

from app.domain import Fix, Window
from app.numerics.answer import answer
from app.numerics.corners import Corner, every_corner
from app.numerics.index import MapIndex
from app.numerics.matching import may_have_turned, with_hypotheses
from app.numerics.query import ask
from app.numerics.refinement import refine
from app.numerics.stretches import whole_roads


def locate_exhaustively(
    index: MapIndex, window: Window, *, confidence: float = 0.68, turns: bool = False
) -> Fix:
    """
    `app.numerics.matching.locate` without its coarse scale; same arguments, same answer.

    Args:
        turns: Lay the window round every corner, too, as `locate` does with those worth it; else
            along single roads only.
    """
    query = ask(index, window)
    straight = refine(index, query, whole_roads(index, query))

    def answered(corners: list[Corner]) -> Fix:
        placed = with_hypotheses(index, query, straight, corners)
        return answer(index, query, placed.places, confidence, placed.known)

    corners = every_corner(index, query) if turns else []
    fix = answered(corners)
    if turns and may_have_turned(index, query, fix):
        fix = answered(every_corner(index, query, strays=True))
    return fix
