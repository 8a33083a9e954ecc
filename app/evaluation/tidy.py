"""
Tidy measurement rows into passes: a row a reading, rows of one pass and time are one sample.

Streams: one pass is in memory at a time, however large the file.
"""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np
from jaxtyping import Float

from app.domain import LTE_RSRP_RANGE_DBM, Trace
from app.errors import RoadprintError
from app.formats.account import Account
from app.formats.rows import FILLERS_DBM
from app.formats.values import EPOCH_LEAST_S


class BadTable(RoadprintError):
    """The file is no table of readings; the message says what is missing."""

    code = "bad-table"
    title = "The file is no table of readings"


@dataclass(frozen=True, slots=True)
class Columns:
    """
    Where in a row each value stands.

    ``pass_id`` is None when the file is one pass, ``speed_mps`` when it has no such column.
    """

    pass_id: int | None
    time_s: int
    lon: int
    lat: int
    cell_id: int
    rsrp_dbm: int
    speed_mps: int | None

    @classmethod
    def of(cls, header: list[str]) -> Columns:
        """
        Find the columns by name; the time may be called ``time_s`` or ``timestamp_s``.

        Raises:
            BadTable: One is missing.
        """
        at = {name.strip(): i for i, name in enumerate(header)}
        time_s = at.get("time_s", at.get("timestamp_s"))
        missing = [name for name in ("lon", "lat", "cell_id", "rsrp_dbm") if name not in at]
        if missing or time_s is None:
            names = ", ".join(missing + (["time_s"] if time_s is None else []))
            raise BadTable(f"no column {names} among {', '.join(header)[:200]}")
        place = (at["lon"], at["lat"], at["cell_id"], at["rsrp_dbm"])
        return cls(at.get("pass_id"), time_s, *place, at.get("speed_mps"))


@dataclass(frozen=True, slots=True, eq=False)
class Pass:
    """
    One pass of a file, in the file's order.

    Attributes:
        pass_id: Empty when the file names none.
        speed_mps: Of each sample, NaN where the file has none.
    """

    pass_id: str
    trace: Trace
    dropped: Counter[str]
    speed_mps: Float[np.ndarray, " samples"]


def read_passes(lines: Iterable[str], account: Account) -> Iterator[Pass]:
    """
    The passes of a tidy table, each as soon as its last row is read.

    Raises:
        BadTable: A column is missing, or a pass's rows do not stand together.
    """
    rows = csv.reader(lines)
    header = next(rows, None)
    if header is None:
        raise BadTable("the file is empty")
    columns = Columns.of(header)
    done: set[str] = set()
    building: _Building | None = None
    for row in rows:
        account.rows += 1
        if len(row) != len(header):
            account.dropped["wrong number of columns"] += 1
            continue
        pass_id = "" if columns.pass_id is None else row[columns.pass_id]
        if building is None or pass_id != building.pass_id:
            if building is not None:
                yield from building.finish(account)
                done.add(building.pass_id)
            if pass_id in done:
                raise BadTable(f"pass {pass_id} goes on at row {account.rows} after another began")
            building = _Building(pass_id)
        building.add(row, columns)
    if building is not None:
        yield from building.finish(account)


@dataclass(slots=True)
class _Building:
    """A pass while its rows come in."""

    pass_id: str
    time_s: list[float] = field(default_factory=list)
    lon: list[float] = field(default_factory=list)
    lat: list[float] = field(default_factory=list)
    speed_mps: list[float] = field(default_factory=list)
    cells: dict[str, int] = field(default_factory=dict)
    readings: dict[tuple[int, int], float] = field(default_factory=dict)
    dropped: Counter[str] = field(default_factory=Counter)
    last_time: str = ""

    def add(self, row: list[str], columns: Columns) -> None:
        """Take a row in, or count why not."""
        reading = _number(row[columns.rsrp_dbm])
        reason = _refusal(reading)
        if reason is None and row[columns.time_s] != self.last_time:
            reason = self._begin_sample(row, columns)
        if reason is not None:
            self.dropped[reason] += 1
            return
        cell = self.cells.setdefault(row[columns.cell_id], len(self.cells))
        place = (len(self.time_s) - 1, cell)
        if place in self.readings:
            self.dropped["repeated reading"] += 1
        else:
            self.readings[place] = reading

    def finish(self, account: Account) -> Iterator[Pass]:
        """The pass, if any sample came of it."""
        account.dropped.update(self.dropped)
        account.samples += len(self.time_s)
        if not self.time_s:
            return
        rsrp_dbm = np.full((len(self.time_s), len(self.cells)), np.nan, dtype=np.float32)
        places = np.array(list(self.readings), dtype=np.intp)
        rsrp_dbm[places[:, 0], places[:, 1]] = list(self.readings.values())
        start_s = self.time_s[0]
        known = start_s >= EPOCH_LEAST_S
        trace = Trace(
            cells=tuple(self.cells),
            time_s=np.array(self.time_s) - start_s,
            lon=np.array(self.lon),
            lat=np.array(self.lat),
            rsrp_dbm=rsrp_dbm,
            recorded_at=datetime.fromtimestamp(start_s, UTC) if known else None,
        )
        yield Pass(self.pass_id, trace, self.dropped, np.array(self.speed_mps))

    def _begin_sample(self, row: list[str], columns: Columns) -> str | None:
        """Start the sample of a row; the reason why not."""
        time_s, lon, lat = (_number(row[at]) for at in (columns.time_s, columns.lon, columns.lat))
        if not math.isfinite(time_s):
            return "no time"
        if not (abs(lon) <= 180.0 and abs(lat) <= 90.0):
            return "no position"
        if self.time_s and time_s <= self.time_s[-1]:
            return "time goes back"
        self.time_s.append(time_s)
        self.lon.append(lon)
        self.lat.append(lat)
        speed = math.nan if columns.speed_mps is None else _number(row[columns.speed_mps])
        self.speed_mps.append(speed)
        self.last_time = row[columns.time_s]
        return None


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _refusal(reading_dbm: float) -> str | None:
    """Why a reading is none; None when it is one."""
    low_dbm, high_dbm = LTE_RSRP_RANGE_DBM
    if low_dbm <= reading_dbm <= high_dbm:
        return None
    if math.isnan(reading_dbm):
        return "no number"
    if reading_dbm in FILLERS_DBM:
        return "filler"
    return "out of range"
