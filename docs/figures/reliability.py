"""
The reliability that a map of the paper's area measures of itself when it is built.

    .venv/bin/python docs/figures/reliability.py     # writes reliability.png beside this file
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes

from app.domain import Reliability, Road
from app.evaluation.scenario import build_city, preset, survey
from app.numerics.calibration import calibrate
from app.numerics.roadfit import fit_road

mpl.use("agg")
mpl.rcParams.update({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False})

import matplotlib.pyplot as plt  # noqa: E402  # after the backend is chosen

SEED = 7
SCENARIO = replace(preset("harsh"), cells=2)  # with more cells there is next to nothing to doubt


def main() -> None:
    """Draw and write."""
    found = measured()
    figure, (road, radius) = plt.subplots(1, 2, figsize=(7, 3.2), layout="constrained")
    draw_road(road, found)
    draw_radius(radius, found)
    figure.savefig(
        Path(__file__).with_name("reliability.png"), dpi=130, metadata={"Software": None}
    )


def measured() -> Reliability:
    """Of the map of one survey of the area."""
    passes = survey(build_city(SCENARIO, SEED))
    roads = sorted({trace.road_id for trace in passes if trace.road_id is not None})
    models = [
        fit_road(Road(name), [trace for trace in passes if trace.road_id == name]) for name in roads
    ]
    return calibrate(models).reliability


def draw_road(axes: Axes, found: Reliability) -> None:
    """Ten bins of the road's posterior against how often the road was right."""
    axes.plot([0, 1], [0, 1], color="0.8", lw=1)
    for posterior, right, windows in found.curve:
        axes.plot(
            posterior, right, "o", color="C0", ms=3 + 9 * (windows / found.window_count) ** 0.5
        )
        axes.annotate(f"{windows}", (posterior, right), (6, -8), textcoords="offset points")
    axes.set_xlabel("posterior of the road")
    axes.set_ylabel("share of windows whose road was right")
    axes.set_title(f"{found.window_count} held-out windows, ECE {found.ece:.3f}", fontsize=8)


def draw_radius(axes: Axes, found: Reliability) -> None:
    """The radius' confidence against how often it held the truth."""
    axes.plot([0.4, 1], [0.4, 1], color="0.8", lw=1)
    confidence, share = zip(*found.coverage, strict=True)
    axes.plot(confidence, share, "o-", color="C1", ms=4)
    axes.set_xlabel("confidence of the radius")
    axes.set_ylabel("share of windows whose truth it held")
    axes.set_title(f"half within {found.median_m:.2f} m of the truth", fontsize=8)


if __name__ == "__main__":
    main()
