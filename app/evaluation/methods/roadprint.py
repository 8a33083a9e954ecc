"""
`roadprint`: the very code of the service, from `fit_road` to `locate`. No parameter of its own.

Source: `docs/algorithm` of this project; `app.numerics`.
"""

from __future__ import annotations

from app.domain import Window
from app.evaluation.methods.base import Survey
from app.evaluation.methods.roadmap import MapModel, build_index
from app.numerics.matching import locate

name = "roadprint"


class ServiceModel(MapModel):
    """The service, with the radii that it reports."""

    def radius_m(self, window: Window, confidence: float) -> float:
        """The radius at this confidence."""
        return locate(self.index, window, confidence=confidence).accuracy_m


def fit(survey: Survey, seed: int) -> ServiceModel:
    """Build the map; nothing is random."""
    del seed
    return ServiceModel(build_index(survey), locate)
