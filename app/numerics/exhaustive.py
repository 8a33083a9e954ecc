"""
The definition: align the window with the fitted curves at every metre of every road, both ways.

Slow, and plainly right. `app.numerics.matching.locate` must return the same.
"""

from __future__ import annotations

from app.domain import Fix, Window
from app.numerics.answer import answer
from app.numerics.index import MapIndex
from app.numerics.matching import whole_roads
from app.numerics.query import ask
from app.numerics.refinement import refine


def locate_exhaustively(index: MapIndex, window: Window, *, confidence: float = 0.68) -> Fix:
    """`app.numerics.matching.locate` without its coarse scale; same arguments, same answer."""
    query = ask(index, window)
    return answer(index, query, refine(index, query, whole_roads(index, query)), confidence)
