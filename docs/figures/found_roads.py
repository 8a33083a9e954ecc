"""
The picture of docs/algorithms/roads.md: drives of a simulated grid city, and the roads found.

    .venv/bin/python docs/figures/found_roads.py     # writes found_roads.png beside this file
"""

from __future__ import annotations

from itertools import count
from pathlib import Path

import matplotlib as mpl
import numpy as np
import shapely

from app.numerics.geodesy import LocalFrame
from app.numerics.network.finding import find_roads
from app.numerics.network.nouns import Driven

mpl.use("agg")
mpl.rcParams.update({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False})

import matplotlib.pyplot as plt  # noqa: E402  # after the backend is chosen

SEED = 12
STREETS, BLOCK_M, DRIVES, TURNS = 6, 130.0, 22, 6
FRAME = LocalFrame(13.4, 52.5)


def main() -> None:
    """Draw and write."""
    rng = np.random.default_rng(SEED)
    drives = [tour(rng, number) for number in range(DRIVES)]
    found = find_roads(drives, [], (f"road-{number}" for number in count()))
    figure, (before, after) = plt.subplots(1, 2, figsize=(9.0, 4.2), layout="constrained")
    for axes in (before, after):
        for one in drives:
            at = FRAME.to_xy(one.lon, one.lat)
            axes.plot(at.x_m, at.y_m, color="0.75", linewidth=0.5)
        axes.set(xlabel="east, m", aspect="equal", xlim=(-90, 760), ylim=(-90, 760))
    for line in found.lines.values():
        at = FRAME.to_xy(line.lon, line.lat)
        after.plot(at.x_m, at.y_m, linewidth=2.0, marker="o", markevery=[0, -1], markersize=3)
    before.set(title=f"{DRIVES} drives, receivers 4 m off, one with jumps", ylabel="north, m")
    after.set(title=f"{len(found.lines)} roads found")
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=130)


def tour(rng: np.random.Generator, number: int) -> Driven:
    """A drive that turns at random crossings, with stops, a receiver's error and now a jump."""
    at, along_x = rng.integers(0, STREETS, 2), bool(rng.integers(2))
    corners = [at * BLOCK_M]
    for _ in range(TURNS):
        axis = 0 if along_x else 1
        choices = [street for street in range(STREETS) if street != at[axis]]
        at = at.copy()
        at[axis] = rng.choice(choices)
        corners.append(at * BLOCK_M)
        along_x = not along_x
    line = shapely.LineString(corners)
    way_m = np.cumsum(rng.choice([0.0, 8.0, 11.0], int(line.length / 8.0), p=[0.2, 0.4, 0.4]))
    places = shapely.get_coordinates(
        shapely.line_interpolate_point(line, way_m[way_m < line.length])
    )
    places = places + rng.normal(0.0, 3.0, 2) + rng.normal(0.0, 2.0, places.shape)
    if number == 0:
        places[::40] += rng.normal(0.0, 300.0, places[::40].shape)
    degrees = FRAME.to_lonlat(*places.T)
    seconds = np.arange(len(places), dtype=float)
    return Driven(
        f"drive-{number}", np.asarray(degrees.lon), np.asarray(degrees.lat), seconds, True
    )


if __name__ == "__main__":
    main()
