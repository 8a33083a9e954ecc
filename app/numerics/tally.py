"""What a data set holds, counted drive by drive in memory that does not grow with it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from app.domain import Trace
from app.numerics.drive_quality import motion_of
from app.numerics.ground import Ground, GroundSummary

LEVEL_DB = 0.1  # of the histogram of RSRP
LEVELS_DBM = (-160.0, -20.0)
UNDATED = 0  # the one day of all drives without a date
MOST_CELLS = 100_000  # names that are remembered


@dataclass(frozen=True, slots=True)
class Checkup:
    """
    Everything that the doctor looks at. None and empty: nothing says so.

    Attributes:
        hours, kilometres: Gaps left out; ``standing`` is the share of the hours.
        overlapping: Drives that share time with another device's: several phones in one car.
        decimals: Of latitude and longitude, of most samples.
        heard_share: Of the samples that hear one cell, two to five, more.
        rsrp_step_db: 1.0 where all levels are whole, else 0.1.
    """

    drives: int
    samples: int
    readings: int
    days: int
    undated: int
    devices: int
    overlapping: int
    first: datetime | None
    last: datetime | None
    hours: float
    kilometres: float
    standing: float
    interval_s: float
    speed_mps: float
    jumps: int
    jitter_m: float | None
    accuracy_m: float | None
    decimals: tuple[int, int]
    cells: int
    cells_per_sample: float
    serving_only: float
    rsrp_dbm: tuple[float, float, float]
    rsrp_step_db: float
    ground: GroundSummary


@dataclass(slots=True)
class Tally:
    """Counts; `add` drives, then ask for the `checkup`."""

    ground: Ground = field(default_factory=Ground)
    drives: int = 0
    samples: int = 0
    jumps: int = 0
    driven_s: float = 0.0
    standing_s: float = 0.0
    travelled_m: float = 0.0
    undated: int = 0
    days: dict[str, int] = field(default_factory=dict)
    devices: set[str | None] = field(default_factory=set)
    cells: set[str] = field(default_factory=set)
    times: list[tuple[float, float]] = field(default_factory=list)
    first: datetime | None = None
    last: datetime | None = None
    intervals: Counter[float] = field(default_factory=Counter)
    speeds: Counter[float] = field(default_factory=Counter)
    jitters: Counter[float] = field(default_factory=Counter)
    accuracies: Counter[float] = field(default_factory=Counter)
    lon_decimals: Counter[float] = field(default_factory=Counter)
    lat_decimals: Counter[float] = field(default_factory=Counter)
    heard: Counter[float] = field(default_factory=Counter)
    levels: np.ndarray = field(
        default_factory=lambda: np.zeros(round((LEVELS_DBM[1] - LEVELS_DBM[0]) / LEVEL_DB), int)
    )

    def add(self, trace: Trace, accuracy_m: Float[np.ndarray, " samples"] | None = None) -> None:
        """One drive more; ``accuracy_m`` is what the device told, NaN where it did not."""
        self.drives += 1
        self.samples += len(trace.time_s)
        self.devices.add(trace.device)
        if len(self.cells) < MOST_CELLS:
            self.cells.update(trace.cells)
        self._count_positions(trace, self._day(trace))
        known = ~np.isnan(trace.rsrp_dbm)
        self.heard.update(_counted(known.sum(axis=1)))
        bins = np.rint((trace.rsrp_dbm[known] - LEVELS_DBM[0]) / LEVEL_DB).astype(int)
        self.levels += np.bincount(
            np.clip(bins, 0, len(self.levels) - 1), minlength=len(self.levels)
        )
        if accuracy_m is not None:
            told_m = np.asarray(accuracy_m, dtype=np.float64)
            self.accuracies.update(_counted(np.rint(told_m[np.isfinite(told_m)])))

    def _day(self, trace: Trace) -> int:
        if trace.recorded_at is None:
            self.undated += 1
            return UNDATED
        start_s = trace.recorded_at.timestamp()
        self.times.append((start_s, start_s + float(trace.time_s[-1])))
        self.first = min(self.first or trace.recorded_at, trace.recorded_at)
        self.last = max(self.last or trace.recorded_at, trace.recorded_at)
        return self.days.setdefault(trace.recorded_at.date().isoformat(), 1 + len(self.days))

    def _count_positions(self, trace: Trace, day: int) -> None:
        motion = motion_of(trace.time_s, trace.lon, trace.lat)
        self.driven_s += motion.driven_s
        self.standing_s += motion.standing_s
        self.travelled_m += motion.travelled_m
        self.jumps += motion.jumps
        self.intervals.update(_counted(np.round(np.diff(trace.time_s), 1)))
        self.speeds.update(_counted(np.rint(motion.speed_mps * 3.6)))
        if np.isfinite(motion.jitter_m):
            self.jitters[round(motion.jitter_m, 1)] += len(trace.time_s)
        self.lon_decimals[motion.decimals[0]] += len(trace.time_s)
        self.lat_decimals[motion.decimals[1]] += len(trace.time_s)
        for lon, lat in motion.paths:
            self.ground.add(lon, lat, day)

    def checkup(self) -> Checkup | None:
        """The figures; None when no drive was added."""
        if not self.drives:
            return None
        hearing = {count: samples for count, samples in self.heard.items() if count > 0}
        samples = max(sum(hearing.values()), 1)
        readings = int(sum(count * times for count, times in hearing.items()))
        return Checkup(
            drives=self.drives,
            samples=self.samples,
            readings=readings,
            days=len(self.days),
            undated=self.undated,
            devices=len(self.devices),
            overlapping=_overlapping(self.times),
            first=self.first,
            last=self.last,
            hours=self.driven_s / 3600.0,
            kilometres=self.travelled_m / 1000.0,
            standing=self.standing_s / max(self.driven_s, 1e-9),
            interval_s=_median(self.intervals) or 0.0,
            speed_mps=(_median(self.speeds) or 0.0) / 3.6,
            jumps=self.jumps,
            jitter_m=_median(self.jitters),
            accuracy_m=_median(self.accuracies),
            decimals=(_commonest(self.lat_decimals), _commonest(self.lon_decimals)),
            cells=len(self.cells),
            cells_per_sample=readings / samples,
            serving_only=hearing.get(1, 0) / samples,
            rsrp_dbm=self._quantiles_dbm(),
            rsrp_step_db=1.0 if self._whole() else LEVEL_DB,
            ground=self.ground.summary(),
        )

    def _quantiles_dbm(self) -> tuple[float, float, float]:
        """Weakest, median and strongest level; NaN without any."""
        total = np.cumsum(self.levels)
        if not total[-1]:
            return (float("nan"),) * 3
        places = np.searchsorted(total, [1, (total[-1] + 1) // 2, total[-1]])
        low, median, high = (LEVELS_DBM[0] + LEVEL_DB * places).tolist()
        return low, median, high

    def _whole(self) -> bool:
        per_db = round(1.0 / LEVEL_DB)
        return bool(self.levels[::per_db].sum() == self.levels.sum())


def _counted(values: ArrayLike) -> dict[float, int]:
    found, counts = np.unique(values, return_counts=True)
    return dict(zip(found.astype(float).tolist(), counts.tolist(), strict=True))


def _median(counts: Counter[float]) -> float | None:
    if not counts:
        return None
    values = sorted(counts)
    total = np.cumsum([counts[value] for value in values])
    return float(values[int(np.searchsorted(total, (total[-1] + 1) // 2))])


def _commonest(counts: Counter[float]) -> int:
    return int(max(counts, key=lambda value: (counts[value], value)))


def _overlapping(times: list[tuple[float, float]]) -> int:
    """How many of the drives began before an earlier one was over."""
    count, until_s = 0, -np.inf
    for start_s, end_s in sorted(times):
        count += start_s < until_s
        until_s = max(until_s, end_s)
    return count
