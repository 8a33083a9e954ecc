"""
Lag and level of survey passes, and what the truth's own lag means for accuracy: a part of
docs/algorithms/observation-model.md that is made alone.

    .venv/bin/python docs/figures/observation_lags.py [folder]

Writes observation/lags.png and observation/lags.json beside this file. The test passes are not
read. Takes some three minutes of one core.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import matplotlib as mpl
import numpy as np
from observation_data import Driven, fit_folds, load
from observation_windows import Maps, indices

from app.domain import Road, Window
from app.numerics.index import MapIndex
from app.numerics.lines import project
from app.numerics.query import ask
from app.numerics.roadfit import register_road
from app.numerics.stretches import whole_roads

mpl.use("agg")
mpl.rcParams.update({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False})

import matplotlib.pyplot as plt  # noqa: E402  # after the backend is chosen

REAL = Path(__file__).resolve().parents[3] / "shared" / "data" / "santa_monica_att"
OUT = Path(__file__).with_name("observation")
SEED, WINDOWS, EVERY_M = 3, 400, 25.0
LENGTHS_M = (200.0,)
FEWEST_S = 60.0  # driven on other roads, before they say anything of a drive's lag
SHRINK_S = 100.0  # and as much again counts as having no lag


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """A pass with what registration among all passes of its road says of it."""

    driven: Driven
    lag_s: float
    level_db: float

    @property
    def took_s(self) -> float:
        """Time on the road."""
        return float(self.driven.trace.time_s[-1] - self.driven.trace.time_s[0])


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """
    Of windows on the right road and within 100 m: how far ahead of the truth the fix lies.

    Attributes:
        ahead_m: In the direction of travel, against the position as it was recorded.
        lag_s: Of the window's drive, told by its passes of other roads alone; NaN = not known.
        speed_mps: At the window's end.
    """

    ahead_m: np.ndarray
    lag_s: np.ndarray
    speed_mps: np.ndarray


def main() -> None:
    """Measure, draw and write."""
    roads, driven = load(Path(sys.argv[1]) if len(sys.argv) > 1 else REAL)
    told = register_all(roads, driven)
    maps = fit_folds(roads, driven)
    numbers = {
        "days": by_day(told),
        "alike": alike(told),
        "bound": [bound(roads, told, maps, length_m) for length_m in LENGTHS_M],
    }
    (OUT / "lags.json").write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
    draw(told)


def register_all(roads: dict[str, Road], driven: Sequence[Driven]) -> list[Told]:
    """Every pass, in the order of time."""
    by_trace = {id(one.trace): one for one in driven}
    told = [
        Told(by_trace[id(found.trace)], found.lag_s, found.level_db)
        for road_id, road in roads.items()
        if (mine := [one.trace for one in driven if one.road_id == road_id])
        for found in register_road(road, mine)
    ]
    return sorted(told, key=lambda one: str(one.driven.trace.recorded_at))


def by_day(told: Sequence[Told]) -> list[dict[str, float | str]]:
    """Passes, those that moved, lag and level of each day, weighted by time."""
    rows = []
    for day in sorted({one.driven.day for one in told}):
        mine = [one for one in told if one.driven.day == day]
        lag_s, weight = np.array([(one.lag_s, one.took_s) for one in mine]).T
        mean_s = float(np.average(lag_s, weights=weight))
        level_db = np.average([one.level_db for one in mine], weights=weight)
        rows.append(
            {
                "day": day,
                "passes": len(mine),
                "moved": int((lag_s != 0.0).sum()),
                "lag_s": round(mean_s, 2),
                "spread_s": round(
                    float(np.sqrt(np.average((lag_s - mean_s) ** 2, weights=weight))), 2
                ),
                "level_db": round(float(level_db), 1),
            }
        )
    return rows


def alike(told: Sequence[Told]) -> dict[str, float]:
    """How alike the lags of two passes are that share a session, a day, or nothing."""
    moved = [one for one in told if one.lag_s != 0.0]
    kinds: dict[str, list[float]] = {"session": [], "day": [], "apart": []}
    for number, one in enumerate(moved):
        for other in moved[:number]:
            if one.driven.road_id != other.driven.road_id:
                same_day = one.driven.day == other.driven.day
                same = one.driven.session == other.driven.session
                kind = "session" if same else "day" if same_day else "apart"
                kinds[kind].append(one.lag_s * other.lag_s)
    return {
        "passes": len(moved),
        "variance_s2": round(float(np.var([one.lag_s for one in moved])), 3),
        **{f"{kind}_s2": round(float(np.mean(values)), 3) for kind, values in kinds.items()},
    }


def lag_elsewhere(told: Sequence[Told], of: Driven) -> float:
    """Of the drive's session on other roads than this, shrunk; NaN where it hardly drove any."""
    elsewhere = [
        one for one in told if one.driven.session == of.session and one.driven.road_id != of.road_id
    ]
    took_s = sum(one.took_s for one in elsewhere)
    if took_s < FEWEST_S:
        return float("nan")
    return sum(one.lag_s * one.took_s for one in elsewhere) / (took_s + SHRINK_S)


def bound(
    roads: dict[str, Road], told: Sequence[Told], maps: Maps, length_m: float
) -> dict[str, float]:
    """Errors against positions as recorded, and against those without the drive's own lag."""
    usual = indices(maps)
    errors = measure(roads, told, usual, length_m)
    known = ~np.isnan(errors.lag_s)
    ahead_m, lag_s = errors.ahead_m[known], errors.lag_s[known]
    # Readings that are late belong to a place behind the recorded one: there the fix should lie.
    shift_m = -lag_s * errors.speed_mps[known]
    moved = lag_s != 0.0
    slope = float(ahead_m[moved] @ shift_m[moved] / (shift_m[moved] @ shift_m[moved]))
    return {
        "length_m": length_m,
        "windows": len(errors.ahead_m),
        "known": int(known.sum()),
        "median_m": round(float(np.median(np.abs(ahead_m))), 2),
        "median_corrected_m": round(float(np.median(np.abs(ahead_m - shift_m))), 2),
        "rms_m": round(float(np.sqrt(np.mean(np.minimum(np.abs(ahead_m), 40.0) ** 2))), 2),
        "rms_corrected_m": round(
            float(np.sqrt(np.mean(np.minimum(np.abs(ahead_m - shift_m), 40.0) ** 2))), 2
        ),
        "correlation": round(float(np.corrcoef(ahead_m[moved], shift_m[moved])[0, 1]), 3),
        "slope": round(slope, 2),
    }


def measure(
    roads: dict[str, Road], told: Sequence[Told], usual: Sequence[MapIndex], length_m: float
) -> Errors:
    """Windows of passes on held-out days, the best place of all roads."""
    rows = []
    for one in told:
        rows += [(one, *cut) for cut in _cuts(roads[one.driven.road_id], one, length_m)]
    order = np.random.default_rng(SEED).permutation(len(rows))[:WINDOWS]
    found = []
    for one, first, last, sign, chainage_m, speed_mps in (rows[i] for i in order):
        trace = one.driven.trace
        travelled_m = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(chainage_m)))])
        window = Window(
            trace.cells,
            travelled_m[first : last + 1] - travelled_m[first],
            trace.rsrp_dbm[first : last + 1],
        )
        index = usual[one.driven.fold]
        places = whole_roads(index, ask(index, window))
        best = int(places.score.argmax())
        ahead_m = float(sign * (places.chainage_m[best] - chainage_m[last]))
        right = index.road_ids[places.road[best]] == one.driven.road_id
        if right and places.sign[best] == sign and abs(ahead_m) <= 100.0:
            found.append((ahead_m, lag_elsewhere(told, one.driven), speed_mps))
    return Errors(*np.array(found).T)


def _cuts(road: Road, one: Told, length_m: float) -> list[tuple[int, int, int, np.ndarray, float]]:
    """First and last sample, direction, chainages and the speed at the end of each window."""
    if road.line is None:
        return []
    trace = one.driven.trace
    chainage_m = project(road.line, trace.lon, trace.lat).chainage_m
    sign = 1 if chainage_m[-1] >= chainage_m[0] else -1
    travelled_m = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(chainage_m)))])
    cuts = []
    for end_m in np.arange(length_m, travelled_m[-1], EVERY_M):
        last = min(int(np.searchsorted(travelled_m, end_m)), len(travelled_m) - 1)
        first = int(np.searchsorted(travelled_m, travelled_m[last] - length_m))
        near = slice(max(last - 2, 0), min(last + 3, len(travelled_m)))
        driven_m = sign * (chainage_m[near][-1] - chainage_m[near][0])
        speed_mps = driven_m / (trace.time_s[near][-1] - trace.time_s[near][0])
        cuts.append((first, last, sign, chainage_m, float(speed_mps)))
    return cuts


def draw(told: Sequence[Told]) -> None:
    """Every pass's lag in the order of time, days apart; larger where it took longer."""
    figure, axes = plt.subplots(figsize=(7.0, 2.8), layout="constrained")
    day = [one.driven.day for one in told]
    for start in (i for i in range(len(day)) if i == 0 or day[i] != day[i - 1]):
        axes.axvline(start - 0.5, color="0.85", lw=0.7)
        axes.text(start, 2.2, day[start][8:], fontsize=7, color="0.4")
    axes.axhline(0.0, color="0.6", lw=0.7)
    for forward, mark in ((True, "^"), (False, "v")):
        mine = [i for i, one in enumerate(told) if (_heading(one) > 0) == forward]
        size = [4.0 + told[i].took_s / 15.0 for i in mine]
        label = "north- or eastward" if forward else "the other way"
        axes.scatter(mine, [told[i].lag_s for i in mine], s=size, marker=mark, label=label)
    axes.set(xlabel="survey passes in the order of time; days of the month", ylim=(-2.5, 2.5))
    axes.set_ylabel("lag, s")
    axes.legend(frameon=False, loc="lower left")
    figure.savefig(OUT / "lags.png", dpi=130, metadata={"Software": None})


def _heading(one: Told) -> float:
    """Any number whose sign tells the two directions of a street apart."""
    trace = one.driven.trace
    east, north = trace.lon[-1] - trace.lon[0], trace.lat[-1] - trace.lat[0]
    return float(east + north)


if __name__ == "__main__":
    main()
