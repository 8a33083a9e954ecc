"""
`exhaustive`: the window aligned with the fitted curves at every metre of every road, both ways.

Source: ours, `app.numerics.exhaustive`: slow, and the definition of what `roadprint` must return.
Both ask the same map, so that they differ in the search alone.
"""

from __future__ import annotations

from app.evaluation.methods.base import Survey
from app.evaluation.methods.roadmap import MapModel, build_index
from app.numerics.exhaustive import locate_exhaustively

name = "exhaustive"


def fit(survey: Survey, seed: int) -> MapModel:
    """Build the map, or take the one just built; nothing is random."""
    del seed
    return MapModel(build_index(survey), locate_exhaustively)
