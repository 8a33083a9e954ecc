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
from app.numerics.matching import may_have_turned
from app.numerics.query import ask

name = "exhaustive"


class ExhaustiveModel(MapModel):
    """The definition along single roads, as it is compared; and round every corner, too."""

    def with_turns(self, window: Window) -> Fix:
        """All that `roadprint` looks for: some seconds where corners are many."""
        return locate_exhaustively(self.index, window, turns=True)

    def may_have_turned(self, window: Window, fix: Fix) -> bool:
        """Whether that is more than the answer along single roads has, for a short window."""
        return may_have_turned(self.index, ask(self.index, window), fix)


def fit(survey: Survey, seed: int) -> ExhaustiveModel:
    """Build the map, or take the one just built; nothing is random."""
    del seed
    return ExhaustiveModel(build_index(survey), locate_exhaustively)
