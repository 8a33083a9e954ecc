"""Simulated streets some of whose cells come on the air between two surveys, and others go."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

from app.domain import RoadModel, Trace, Window
from app.evaluation.scenario import City, build_city, preset, survey, windows
from app.evaluation.truth import Labelled
from app.numerics.index import MapIndex
from app.numerics.roadfit import fit_road
from tests.numerics.cities import index_with

EARLY_PASSES = 2
WINDOWS = 160
LENGTH_M = 60.0


@dataclass(frozen=True, slots=True, eq=False)
class Grown:
    """A city's roads before and after half of them were driven anew, and windows of today."""

    before: dict[str, RoadModel]
    after: dict[str, RoadModel]
    anew: frozenset[str]
    asked: tuple[Labelled, ...]

    def index(self, anew: frozenset[str], *, dated: bool = True) -> MapIndex:
        """The map whose roads were driven anew where said; without days, as maps were before."""
        models = [self.after[i] if i in anew else self.before[i] for i in self.before]
        return index_with(models if dated else [replace(one, heard_on={}) for one in models])


@cache
def grown(seed: int) -> Grown:
    """A third of the cells come on the air, a sixth go; all roads are driven twice before."""
    city = _city(seed)
    cells = sorted({cell for truth in city.roads for cell in truth.cells})
    come, gone = frozenset(cells[::3]), frozenset(cells[1::6])
    before, after = {}, {}
    for truth in city.roads:
        passes = [one for one in survey(city) if one.road_id == truth.road_id]
        early = [_without(one, come) for one in passes[:EARLY_PASSES]]
        late = [_without(one, gone) for one in passes[EARLY_PASSES:]]
        before[truth.road_id] = fit_road(truth.road, early)
        after[truth.road_id] = fit_road(truth.road, [*early, *late])
    asked = [_heard(one, gone) for one in windows(city, WINDOWS, length_m=LENGTH_M)]
    anew = frozenset([truth.road_id for truth in city.roads][::2])
    return Grown(before, after, anew, tuple(asked))


def _city(seed: int) -> City:
    scenario = replace(
        preset("city"),
        roads=14,
        cells=30,
        sample_interval_s=1.0,
        noise_db=3.0,
        drift_db=3.0,
        sensitivity_dbm=-110.0,
        survey_passes=EARLY_PASSES + 1,
    )
    return build_city(scenario, seed)


def _without(trace: Trace, cells: frozenset[str]) -> Trace:
    kept = [at for at, cell in enumerate(trace.cells) if cell not in cells]
    names = tuple(trace.cells[at] for at in kept)
    return replace(trace, cells=names, rsrp_dbm=trace.rsrp_dbm[:, kept], reference_cell=None)


def _heard(one: Labelled, gone: frozenset[str]) -> Labelled:
    window = one.window
    kept = [at for at, cell in enumerate(window.cells) if cell not in gone]
    names = tuple(window.cells[at] for at in kept)
    return Labelled(Window(names, window.distance_m, window.rsrp_dbm[:, kept]), one.truth)
