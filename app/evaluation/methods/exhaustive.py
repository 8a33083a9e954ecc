"""
`exhaustive`: the window aligned with the fitted curves at every metre of every road, both ways.

Source: ours, `app.numerics.exhaustive`: slow, and the definition of what `roadprint` must return.
Both ask the same map, so that they differ in the search alone.
"""

from __future__ import annotations

from app.domain import Fix, Window
from app.evaluation.methods.base import Survey
from app.evaluation.methods.roadmap import MapModel, build_index
from app.numerics.exhaustive import locate_exhaustively

name = "exhaustive"


class ExhaustiveModel(MapModel):
    """The definition along single roads, as it is compared; and round every corner, too."""

    def with_turns(self, window: Window) -> Fix:
        """All that `roadprint` looks for: some seconds where corners are many."""
        return locate_exhaustively(self.index, window, turns=True)


def fit(survey: Survey, seed: int) -> ExhaustiveModel:
    """Build the map, or take the one just built; nothing is random."""
    del seed
    return ExhaustiveModel(build_index(survey), locate_exhaustively)
