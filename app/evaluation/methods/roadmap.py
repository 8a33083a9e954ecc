"""The service's own map of a survey, shared by the two methods that ask it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from app.domain import Fix, RadioMap, Window
from app.errors import CannotBuildRoad
from app.evaluation.methods.base import Estimate, Previous, Survey
from app.numerics.calibration import calibrate
from app.numerics.index import MapIndex
from app.numerics.roadfit import fit_road


@lru_cache(maxsize=1)
def build_map(survey: Survey) -> RadioMap:
    """
    Fit every road of a survey and calibrate: what a build of the service does.

    Roads that cannot be built are missing, as they are in the service. Remembers the last survey,
    so that `roadprint` and `exhaustive` share one map.
    """
    models = []
    for road in survey.roads:
        passes = [trace for trace in survey.traces if trace.road_id == road.road_id]
        try:
            models.append(fit_road(road, passes))
        except CannotBuildRoad:
            continue
    return RadioMap(1, tuple(models), calibrate(models))


@lru_cache(maxsize=1)
def build_index(survey: Survey) -> MapIndex:
    """The map of a survey, arranged for matching; the last one is remembered as well."""
    return MapIndex.build(build_map(survey))


@dataclass(frozen=True, eq=False)
class MapModel:
    """A map index behind one of the two ways to ask it."""

    index: MapIndex
    ask: Callable[..., Fix]

    def locate(self, window: Window, previous: Previous | None) -> Estimate:
        """The service's fix; each window stands alone, so ``previous`` is not used."""
        del previous
        fix = self.ask(self.index, window)
        return Estimate(
            fix.road_id,
            fix.chainage_m,
            fix.lon,
            fix.lat,
            fix.direction,
            fix.segment_posterior,
            (fix.segment_start_m, fix.segment_end_m),
            not fix.off_map,
            fix,
        )
