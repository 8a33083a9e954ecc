"""From a plan to a city: who is heard where, how loud on average, and the shadowing over it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.domain import Line
from app.evaluation.scenario.city import City, RoadTruth
from app.evaluation.scenario.layout import Layout, Site, Street, make_layout
from app.evaluation.scenario.params import Scenario
from app.evaluation.scenario.propagation import ABOVE_ROOFTOP, BELOW_ROOFTOP, blended_loss_db
from app.evaluation.scenario.shadowing import Field
from app.evaluation.scenario.sight import seen_share, sees
from app.evaluation.streams import Purpose, stream
from app.numerics.geodesy import LocalFrame
from app.numerics.lines import length_m

GRID_STEP_M = 0.25  # a fiftieth of the shadowing's correlation distance: between, it is linear
SIGHT_STEP_M = 1.0  # corners are softened over many metres
HEARD_RANGE = (6, 12)  # how many cells a road of the grid hears: phones report the strongest only
HEARING_CANDIDATES = 30  # small cells looked at: the strongest are among the nearest


@dataclass(frozen=True, slots=True)
class Fields:
    """The random part of a city's means."""

    shadowing: Field
    drift: Field


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A straight road in the plan: metres at its evenly spaced places."""

    x_m: Float[np.ndarray, " places"]
    y_m: Float[np.ndarray, " places"]


def build_city(scenario: Scenario, seed: int) -> City:
    """
    The city of a scenario: same scenario and seed, same city, on any machine.

    A cell's mean does not depend on how many other cells there are.
    """
    layout = make_layout(scenario, seed)
    fields = Fields(
        Field(
            layout,
            seed,
            (Purpose.SHADOWING_NODES, Purpose.SHADOWING_ROAD),
            scenario.shadowing_correlation_m,
        ),
        Field(
            layout, seed, (Purpose.DRIFT_NODES, Purpose.DRIFT_ROAD), scenario.drift_correlation_m
        ),
    )
    roads = tuple(
        _road_truth(scenario, seed, layout, index, fields) for index in range(len(layout.streets))
    )
    return City(scenario, seed, layout, roads)


def _road_truth(
    scenario: Scenario, seed: int, layout: Layout, index: int, fields: Fields
) -> RoadTruth:
    street = layout.streets[index]
    line = _on_earth(layout, street, scenario)
    length = length_m(line)
    steps = int(np.ceil(length / GRID_STEP_M)) + 1
    cells = _heard_cells(scenario, seed, layout, index)
    sites = [layout.sites[cell] for cell in cells]
    share = np.stack([_los_share(layout, street, site, scenario, steps) for site in sites], axis=1)
    path = _path(layout, street, steps)
    columns = [_median_dbm(path, site, share[:, i], scenario) for i, site in enumerate(sites)]
    median_dbm = np.stack(columns, axis=1)
    spread_db = share * scenario.shadowing_los_db + (1.0 - share) * scenario.shadowing_nlos_db
    step_m = length / (steps - 1)
    shadow = fields.shadowing.along(street, index, cells, steps, step_m)
    survey_dbm = median_dbm + spread_db * shadow
    drive_dbm = survey_dbm
    if scenario.drift_db > 0:
        change = fields.drift.along(street, index, cells, steps, step_m)
        drive_dbm = survey_dbm + scenario.drift_db * change
    names = tuple(site.cell for site in sites)
    levels = (survey_dbm, drive_dbm, median_dbm, spread_db)
    return RoadTruth(street.road_id, index, line, length, names, *levels)


def _on_earth(layout: Layout, street: Street, scenario: Scenario) -> Line:
    ends = _path(layout, street, 2)
    placed = LocalFrame(scenario.origin_lon, scenario.origin_lat).to_lonlat(ends.x_m, ends.y_m)
    return Line(placed.lon, placed.lat)


def _path(layout: Layout, street: Street, places: int) -> Path:
    start, end = layout.nodes[street.start_node], layout.nodes[street.end_node]
    share = np.arange(places) / (places - 1)
    return Path(
        start[0] + share * (end[0] - start[0]),
        start[1] + share * (end[1] - start[1]),
    )


def _heard_cells(scenario: Scenario, seed: int, layout: Layout, index: int) -> list[int]:
    """
    Cells that a road's phones report, in the city's order.

    In the square all; in the grid the 6 to 12 with the strongest median at the road's middle.
    """
    if scenario.layout == "square":
        return list(range(len(layout.sites)))
    middle = _path(layout, layout.streets[index], 3)
    x_m, y_m = float(middle.x_m[1]), float(middle.y_m[1])
    away_m = {i: np.hypot(s.x_m - x_m, s.y_m - y_m) for i, s in enumerate(layout.sites)}
    nearest = sorted(away_m, key=lambda i: (not layout.sites[i].macro, away_m[i], i))
    macros = sum(site.macro for site in layout.sites)
    power = {
        i: _median_at(layout, x_m, y_m, layout.sites[i], scenario)
        for i in nearest[: macros + HEARING_CANDIDATES]
    }
    least, most = HEARD_RANGE
    count = int(stream(seed, Purpose.HEARD_COUNT, index).integers(least, most + 1))
    return sorted(sorted(power, key=lambda i: (-power[i], i))[:count])


def _median_at(layout: Layout, x_m: float, y_m: float, site: Site, scenario: Scenario) -> float:
    point = Path(np.array([x_m]), np.array([y_m]))
    seen = sees(point.x_m, point.y_m, site, layout.between(x_m, y_m, site))
    return float(_median_dbm(point, site, seen.astype(float), scenario)[0])


def _los_share(
    layout: Layout, street: Street, site: Site, scenario: Scenario, steps: int
) -> Float[np.ndarray, " steps"]:
    """Line of sight along a road, softened at corners, at the grid's places."""
    start, end = layout.nodes[street.start_node], layout.nodes[street.end_node]
    extent_m = float(np.hypot(end[0] - start[0], end[1] - start[1]))
    coarse = _path(layout, street, int(np.ceil(extent_m / SIGHT_STEP_M)) + 1)
    near = np.concatenate([layout.between(*start, site), layout.between(*end, site)])
    seen = sees(coarse.x_m, coarse.y_m, site, near)
    share = seen_share(seen, int(scenario.corner_m / SIGHT_STEP_M / 2.0))
    at = np.arange(steps) / (steps - 1) * (len(share) - 1)
    return np.interp(at, np.arange(len(share)), share)


def _median_dbm(
    path: Path, site: Site, los_share: Float[np.ndarray, " places"], scenario: Scenario
) -> Float[np.ndarray, " places"]:
    flat_m = np.hypot(path.x_m - site.x_m, path.y_m - site.y_m)
    environment = ABOVE_ROOFTOP if site.macro else BELOW_ROOFTOP
    loss_db = blended_loss_db(
        np.hypot(flat_m, site.rise_m), los_share, scenario.frequency_ghz, environment
    )
    return site.eirp_dbm - loss_db
