"""The roads that appear from drives: each step of the method in its order."""

from __future__ import annotations

from collections.abc import Sequence

from app.numerics.geodesy import Floats
from app.numerics.network.chains import Chains
from app.numerics.network.contraction import contract
from app.numerics.network.finishing import finish
from app.numerics.network.links import corner_links, straight_links
from app.numerics.network.runs import cut_at_turns
from app.numerics.network.spurs import without_spurs
from app.numerics.network.steps import Piece
from app.numerics.network.strokes import cover


def roads_of(
    pieces: Sequence[Piece],
    seeds: Sequence[Floats] = (),
    given: Sequence[Floats] = (),
    before: Sequence[Floats] = (),
) -> list[Floats]:
    """
    Centre lines of the roads that the pieces of drives run along.

    The order of the drives moves nothing but the last digits.

    Args:
        pieces: Cleaned drives, without what of them runs along given roads.
        seeds: Stretches that are roads already, in steps of some 5 m; what the pieces add to them
            is joined to them.
        given: Lines of given roads: the ends of roads are brought to them.
        before: Lines of roads that were found before; where they are driven they stay roads.

    Returns:
        Polylines in local metres, each of shape ``(vertices, 2)``.
    """
    runs = cut_at_turns(pieces)
    contracted = contract(runs)
    strokes = cover(runs, contracted, seeds, before)
    followed = [strokes.under(run) for run in contracted]
    chains = Chains(strokes.lines)
    for link in straight_links(strokes, followed):
        chains.join_straight(link)
    for link in corner_links(strokes, pieces, runs, followed):
        chains.join_corner(link)
    return finish(without_spurs(chains.lines, runs, contracted, seeds, before), given, seeds)
