"""Neutral rows: what every format is turned into, a block at a time."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from app.domain import LTE_RSRP_RANGE_DBM, NR_RSRP_RANGE_DBM
from app.formats import account as reasons
from app.formats.account import Account
from app.formats.swap import looks_swapped

MOST_INT = 2147483647.0  # Android's "unavailable"
FILLERS_DBM = (-30.0, 127.0, MOST_INT)  # what tools write for "not measured"
MAX_ACCURACY_M = 100.0  # beyond, the position came from cells or wifi and names no street
MOST_CELL_CHARACTERS = 128  # as the API has it
MOST_NAME_CHARACTERS = 200  # the same
UNKNOWN = -1


@dataclass(frozen=True, slots=True)
class DriveLabel:
    """
    Who drove: ``name`` is the file's own name for the drive, None when it has none.

    A named drive is one drive; the others are cut at long gaps.
    """

    device: str | None = None
    name: str | None = None


@dataclass(slots=True)
class Labels:
    """
    Words of a file as small numbers, the same in all of its blocks.

    ``global_ids`` has the global id of a cell that is keyed otherwise, once it was seen.
    """

    cells: dict[str, int] = field(default_factory=dict)
    drives: dict[DriveLabel, int] = field(default_factory=dict)
    global_ids: dict[str, str] = field(default_factory=dict)

    def cell(self, key: str | None, global_id: str | None = None) -> int:
        """The number of a cell; `UNKNOWN` without a key."""
        if key is None or len(key) > MOST_CELL_CHARACTERS or not key.isprintable():
            return UNKNOWN
        if global_id is not None and global_id != key:
            self.global_ids.setdefault(key, global_id)
        return self.cells.setdefault(key, len(self.cells))

    def drive(self, label: DriveLabel) -> int:
        """The number of a drive; a device's name is made one that can be stored."""
        device = "".join(filter(str.isprintable, label.device or ""))[:MOST_NAME_CHARACTERS]
        label = DriveLabel(device.strip() or None, label.name)
        return self.drives.setdefault(label, len(self.drives))


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """
    One reading a row, column by column; every array has shape ``(rows,)``.

    Attributes:
        line: Line (or record) of the file, from 1.
        drive, cell: Numbers of `Labels`; `UNKNOWN` where the row names no cell.
        time_s: UTC, seconds since 1970, or seconds from the drive's start.
        lon, lat: WGS 84 degrees.
        speed_mps, accuracy_m: NaN when not told.
        rsrp_dbm: As written.
        serving: 1, 0, or `UNKNOWN`.
        nr: NR's range of levels applies, not LTE's.

    In numbers NaN is missing and infinity is a text that is no number.
    """

    line: NDArray[np.int64]
    drive: NDArray[np.int32]
    time_s: NDArray[np.float64]
    lon: NDArray[np.float64]
    lat: NDArray[np.float64]
    speed_mps: NDArray[np.float32]
    accuracy_m: NDArray[np.float32]
    cell: NDArray[np.int32]
    rsrp_dbm: NDArray[np.float64]
    serving: NDArray[np.int8]
    nr: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.line)

    def take(self, which: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Rows:
        """Some of the rows."""
        return Rows(*(getattr(self, each.name)[which] for each in fields(self)))

    @classmethod
    def join(cls, parts: list[Rows]) -> Rows:
        """Blocks one after another."""
        if len(parts) == 1:
            return parts[0]
        names = [each.name for each in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(slots=True)
class RowList:
    """Rows that grow one by one, for formats that are no tables."""

    line: list[int] = field(default_factory=list)
    drive: list[int] = field(default_factory=list)
    time_s: list[float] = field(default_factory=list)
    lon: list[float] = field(default_factory=list)
    lat: list[float] = field(default_factory=list)
    speed_mps: list[float] = field(default_factory=list)
    accuracy_m: list[float] = field(default_factory=list)
    cell: list[int] = field(default_factory=list)
    rsrp_dbm: list[float] = field(default_factory=list)
    serving: list[int] = field(default_factory=list)
    nr: list[bool] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.line)

    def add(self, fix: Fix, cell: int, rsrp_dbm: float, *, serving: int, nr: bool) -> Self:
        """One more reading."""
        for name in ("line", "drive", "time_s", "lon", "lat", "speed_mps", "accuracy_m"):
            getattr(self, name).append(getattr(fix, name))
        self.cell.append(cell)
        self.rsrp_dbm.append(rsrp_dbm)
        self.serving.append(serving)
        self.nr.append(nr)
        return self

    def rows(self) -> Rows:
        """All of them as arrays."""
        return Rows(
            line=np.array(self.line, np.int64),
            drive=np.array(self.drive, np.int32),
            time_s=np.array(self.time_s, np.float64),
            lon=np.array(self.lon, np.float64),
            lat=np.array(self.lat, np.float64),
            speed_mps=np.array(self.speed_mps, np.float32),
            accuracy_m=np.array(self.accuracy_m, np.float32),
            cell=np.array(self.cell, np.int32),
            rsrp_dbm=np.array(self.rsrp_dbm, np.float64),
            serving=np.array(self.serving, np.int8),
            nr=np.array(self.nr, bool),
        )


@dataclass(frozen=True, slots=True)
class Fix:
    """When and where a report was made; the fields are those of `Rows`."""

    line: int
    drive: int
    time_s: float
    lon: float
    lat: float
    speed_mps: float = float("nan")
    accuracy_m: float = float("nan")


def sift(rows: Rows, account: Account) -> Rows:
    """The rows that are readings; the others are dropped, each by the first reason that holds."""
    low_dbm = np.where(rows.nr, NR_RSRP_RANGE_DBM[0], LTE_RSRP_RANGE_DBM[0])
    high_dbm = np.where(rows.nr, NR_RSRP_RANGE_DBM[1], LTE_RSRP_RANGE_DBM[1])
    out = (np.abs(rows.lat) > 90.0) | (np.abs(rows.lon) > 180.0)
    tests = {
        reasons.NO_LEVEL: np.isnan(rows.rsrp_dbm),
        reasons.NOT_A_NUMBER: np.isinf(rows.rsrp_dbm) | np.isinf(rows.lon) | np.isinf(rows.lat),
        reasons.NOT_A_TIME: np.isinf(rows.time_s),
        reasons.FILLER: np.isin(rows.rsrp_dbm, FILLERS_DBM),
        reasons.OUT_OF_RANGE: (rows.rsrp_dbm < low_dbm) | (rows.rsrp_dbm > high_dbm),
        reasons.NO_CELL: rows.cell == UNKNOWN,
        reasons.NO_TIME: np.isnan(rows.time_s),
        reasons.NO_POSITION: np.isnan(rows.lon) | np.isnan(rows.lat)
        | (rows.lon == MOST_INT) | (rows.lat == MOST_INT)
        | ((rows.lon == 0.0) & (rows.lat == 0.0)),  # what a phone writes before its first fix
        reasons.SWAPPED: out & looks_swapped(rows.lon, rows.lat),
        reasons.POSITION_OUT_OF_RANGE: out,
        reasons.INACCURATE: rows.accuracy_m > MAX_ACCURACY_M,
    }  # fmt: skip
    kept = np.ones(len(rows), bool)
    for reason, wrong in tests.items():
        dropped = kept & wrong
        if dropped.any():
            account.drop(reason, rows.line[dropped])
            kept &= ~wrong
    return rows if kept.all() else rows.take(kept)
