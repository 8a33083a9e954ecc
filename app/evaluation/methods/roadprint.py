"""
`roadprint`: the very code of the service, from `fit_road` to `locate`. No parameter of its own.

Source: `docs/algorithm` of this project; `app.numerics`.
"""

from __future__ import annotations

from app.evaluation.methods.base import Survey
from app.evaluation.methods.roadmap import MapModel, build_index
from app.numerics.matching import locate

name = "roadprint"


def fit(survey: Survey, seed: int) -> MapModel:
    """Build the map; nothing is random."""
    del seed
    return MapModel(build_index(survey), locate)
