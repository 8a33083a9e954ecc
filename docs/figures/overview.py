"""
The picture of the README: the paper's area, its curves and sub-segments, and located windows.

    .venv/bin/python docs/figures/overview.py     # writes overview.png beside this file
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from app.domain import RadioMap, Road, RoadModel, Trace
from app.evaluation.scenario import build_city, preset, survey, windows
from app.evaluation.truth import Labelled
from app.numerics.calibration import calibrate
from app.numerics.geodesy import LocalFrame, distance_m
from app.numerics.index import MapIndex
from app.numerics.matching import locate
from app.numerics.roadfit import fit_road

mpl.use("agg")
mpl.rcParams.update({"font.size": 8, "axes.spines.top": False})

import matplotlib.pyplot as plt  # noqa: E402  # after the backend is chosen

SEED = 7
COUNT = 200


def main() -> None:
    """Draw and write."""
    city = build_city(preset("paper"), SEED)
    traces = {trace.road_id: trace for trace in survey(city)}
    models = [fit_road(Road(name), [trace]) for name, trace in sorted(traces.items())]
    index = MapIndex.build(RadioMap(1, tuple(models), calibrate(models)))
    figure, (plan, curves) = plt.subplots(
        1, 2, figsize=(9.5, 3.6), width_ratios=(1, 1.7), layout="constrained"
    )
    draw_plan(plan, index, models, windows(city, COUNT))
    draw_curves(curves, models[0], traces[models[0].road_id])
    figure.savefig(Path(__file__).with_name("overview.png"), dpi=130, metadata={"Software": None})


def draw_plan(axes: Axes, index: MapIndex, models: list[RoadModel], asked: list[Labelled]) -> None:
    """Roads with their sub-segments' middles, and every fix in the colour of its error."""
    frame = LocalFrame(float(models[0].line.lon[0]), float(models[0].line.lat[0]))
    for model in models:
        road = frame.to_xy(model.line.lon, model.line.lat)
        axes.plot(road.x_m, road.y_m, color="0.8", lw=5, solid_capstyle="round", zorder=1)
        cuts = [(s.mid_lon, s.mid_lat) for s in model.segments]
        spots = frame.to_xy(*np.array(cuts).T)
        axes.plot(spots.x_m, spots.y_m, "|", color="0.5", ms=5, zorder=2)
    fixes = [locate(index, one.window) for one in asked]
    at = frame.to_xy([fix.lon for fix in fixes], [fix.lat for fix in fixes])
    truth = [(one.truth.lon, one.truth.lat) for one in asked]
    lon, lat = np.array(truth).T
    error_m = distance_m([fix.lon for fix in fixes], [fix.lat for fix in fixes], lon, lat)
    dots = axes.scatter(
        at.x_m, at.y_m, c=error_m, s=9, cmap="viridis_r", vmin=0, vmax=0.6, zorder=3
    )
    plt.colorbar(dots, ax=axes, label="error, m", shrink=0.8)
    axes.set_aspect("equal")
    axes.set_title(
        f"{COUNT} windows of 30 m located:\nmean error {error_m.mean():.2f} m", fontsize=8
    )
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")


def draw_curves(axes: Axes, model: RoadModel, trace: Trace) -> None:
    """Readings and curves of three cells along one road, and where it is cut."""
    grid_m = np.arange(len(model.mean_dbm)) * model.step_m
    along_m = np.linspace(0.0, model.length_m, len(trace.lon))
    for column, cell in enumerate(model.cells[:3]):
        readings = trace.rsrp_dbm[:, trace.cells.index(cell)]
        (line,) = axes.plot(grid_m, model.mean_dbm[:, column], lw=1.3, label=cell)
        axes.plot(along_m[::2], readings[::2], ".", ms=1.6, color=line.get_color(), alpha=0.5)
        spread_db = model.spread_db[:, column]
        low, high = (model.mean_dbm[:, column] + sign * spread_db for sign in (-1, 1))
        axes.fill_between(grid_m, low, high, color=line.get_color(), alpha=0.12, lw=0)
    for segment in model.segments[1:]:
        axes.axvline(segment.start_m, color="0.7", lw=0.7, ls=":")
    axes.set_title(f"{model.road_id}: readings, fitted curves, sub-segments", fontsize=8)
    axes.set_xlabel("chainage, m")
    axes.set_ylabel("RSRP, dBm")
    axes.legend(frameon=False, loc="upper center", ncol=3)
    axes.set_ylim(top=axes.get_ylim()[1] + 8)


if __name__ == "__main__":
    main()
