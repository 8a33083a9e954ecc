"""Where roads, buildings and cells stand: plain metres east and north of the origin."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.evaluation.scenario.params import Scenario
from app.evaluation.streams import Purpose, stream

SMALL_EIRP_DBM = 11.0  # 5 W and 5 dBi, spread over the 1200 resource elements of 20 MHz
MACRO_EIRP_DBM = 30.0  # 40 W and 15 dBi, the same
SMALL_HEIGHT_M = 10.0
MACRO_HEIGHT_M = 40.0
VEHICLE_HEIGHT_M = 1.5
EARFCN = 2850  # band 7, 2.63 GHz

BLOCK_M = 200.0
STREET_WIDTH_M = 24.0
MACRO_SPACING_BLOCKS = 5  # a macro cell a square kilometre
SITE_REACH_M = (15.0, 60.0)  # how far from its crossing a small cell of the grid may stand


@dataclass(frozen=True, slots=True)
class Site:
    """One cell's antenna."""

    cell: str
    x_m: float
    y_m: float
    macro: bool

    @property
    def eirp_dbm(self) -> float:
        """Power of one resource element, which RSRP is measured on, with the antenna's gain."""
        return MACRO_EIRP_DBM if self.macro else SMALL_EIRP_DBM

    @property
    def rise_m(self) -> float:
        """Height above the vehicle's antenna."""
        return (MACRO_HEIGHT_M if self.macro else SMALL_HEIGHT_M) - VEHICLE_HEIGHT_M


@dataclass(frozen=True, slots=True)
class Street:
    """A straight road between two crossings, given by their indices."""

    road_id: str
    start_node: int
    end_node: int


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """
    A city's plan, metres east and north of its origin.

    Attributes:
        nodes: The crossings as (x, y).
        buildings: Blocks taller than every antenna, a row each: west, south, east, north wall.
    """

    nodes: tuple[tuple[float, float], ...]
    streets: tuple[Street, ...]
    buildings: Float[np.ndarray, "buildings 4"]
    sites: tuple[Site, ...]

    def between(self, x_m: float, y_m: float, site: Site) -> Float[np.ndarray, "near 4"]:
        """Buildings within the rectangle spanned by a point and a site: no other can hide it."""
        west, east = sorted((x_m, site.x_m))
        south, north = sorted((y_m, site.y_m))
        walls = self.buildings
        across = (walls[:, 0] < east) & (walls[:, 2] > west)
        return walls[across & (walls[:, 1] < north) & (walls[:, 3] > south)]


def make_layout(scenario: Scenario, seed: int) -> Layout:
    """The plan of a scenario; its first cells are the same however many are asked for."""
    return _square(scenario) if scenario.layout == "square" else _grid(scenario, seed)


def _square(scenario: Scenario) -> Layout:
    """The paper's area: a high-rise inside four roads of 400 m, six cells about them."""
    corners = ((100.0, 100.0), (500.0, 100.0), (500.0, 500.0), (100.0, 500.0))
    names = ("south", "east", "north", "west")
    streets = tuple(Street(f"road-{name}", i, (i + 1) % 4) for i, name in enumerate(names))
    places = (
        (20.0, 580.0),  # the macro cell, beyond the north-west corner
        (84.0, 236.0),
        (516.0, 172.0),
        (347.0, 83.0),
        (255.0, 517.0),
        (514.0, 455.0),
    )
    sites = tuple(
        Site(f"{EARFCN}:{11 * (i + 1)}", x, y, macro=i == 0) for i, (x, y) in enumerate(places)
    )
    return Layout(
        corners, streets, np.array([[125.0, 125.0, 475.0, 475.0]]), sites[: scenario.cells]
    )


def _grid(scenario: Scenario, seed: int) -> Layout:
    """Square blocks with streets between them; a road is one side of a block."""
    side = 2
    while 2 * side * (side - 1) < scenario.roads:
        side += 1
    nodes = tuple(
        (BLOCK_M * column, BLOCK_M * row) for row in range(side) for column in range(side)
    )
    ends = [(n, n + 1) for n in range(side * side) if (n + 1) % side]
    ends += [(n, n + side) for n in range(side * (side - 1))]
    ends.sort()
    digits = max(4, len(str(scenario.roads)))
    streets = tuple(
        Street(f"road-{i + 1:0{digits}}", start, end)
        for i, (start, end) in enumerate(ends[: scenario.roads])
    )
    return Layout(nodes, streets, _blocks(side), _grid_sites(scenario, seed, side))


def _blocks(side: int) -> Float[np.ndarray, "blocks 4"]:
    inset = STREET_WIDTH_M / 2.0
    corner = BLOCK_M * np.arange(side - 1)
    west, south = (each.ravel() for each in np.meshgrid(corner, corner))
    near, far = inset, BLOCK_M - inset
    return np.stack([west + near, south + near, west + far, south + far], axis=1)


def _grid_sites(scenario: Scenario, seed: int, side: int) -> tuple[Site, ...]:
    """Macro cells on a coarse lattice, then small cells near crossings, every second one first."""
    lattice = range(MACRO_SPACING_BLOCKS // 2, max(side, 3), MACRO_SPACING_BLOCKS)
    half = BLOCK_M / 2.0  # in the middle of a block, on its roof
    places = [(BLOCK_M * c + half, BLOCK_M * r + half) for r in lattice for c in lattice]
    macro_count = len(places)
    order = stream(seed, Purpose.SITES).permutation(side * side).tolist()
    order.sort(key=lambda node: (node // side + node % side) % 2)  # stable: the draw decides within
    for small in range(max(0, scenario.cells - macro_count)):
        node = order[small % len(order)]
        places.append(_beside_crossing(seed, small, node // side, node % side))
    sites = (
        Site(_grid_cell_name(i), x, y, macro=i < macro_count)
        for i, (x, y) in enumerate(places[: scenario.cells])
    )
    return tuple(sites)


def _beside_crossing(seed: int, small: int, row: int, column: int) -> tuple[float, float]:
    """At the edge of a street of either direction, some metres from the crossing."""
    rng = stream(seed, Purpose.SITES, small)
    along = float(rng.uniform(*SITE_REACH_M)) * math.copysign(1.0, rng.uniform(-1.0, 1.0))
    aside = 0.4 * STREET_WIDTH_M * math.copysign(1.0, rng.uniform(-1.0, 1.0))
    east, north = (along, aside) if rng.uniform() < 0.5 else (aside, along)
    return BLOCK_M * column + east, BLOCK_M * row + north


def _grid_cell_name(index: int) -> str:
    """``earfcn:pci``, unique: there are 504 physical cell ids on a carrier."""
    return f"{EARFCN + 50 * (index // 504)}:{index % 504}"
