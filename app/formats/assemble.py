"""
Rows of many drives, in any order, into one trace a drive.

Memory is flat: rows wait in compact columns until their drive is over, and at most
`MOST_WAITING_ROWS` wait. A drive that is longer comes out in parts, which costs nothing: the map is
built from stretches.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from app.domain import Trace
from app.formats import account as reasons
from app.formats.account import Account
from app.formats.order import runs_in_time, steps_m
from app.formats.rows import DriveLabel, Labels, Rows
from app.formats.stale import repeated_neighbours
from app.formats.values import EPOCH_LEAST_S

DRIVE_GAP_S = 300.0  # a silence this long ends a drive that the file does not name itself
JUMP_M = 10_000.0  # between two samples of a drive: no survey takes it (app.api.checks)
LEAST_SAMPLES = 2  # one sample spans no stretch of road
MOST_WAITING_ROWS = 500_000  # 54 bytes each, and three times that while they are sorted
MOST_TRACE_VALUES = 2_000_000  # samples x cells of one trace: a JSON body of some 16 MB

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """
    One drive of a file, as it is stored.

    Attributes:
        name: The file's name for it with the number of its part, for messages and keys.
        line: Of its first sample, for messages.
        dropped: Readings left out while its rows became samples, by reason.
        speed_mps, accuracy_m: As the device told them, a number a sample; NaN = not told.
    """

    name: str
    trace: Trace
    dropped: Mapping[str, int]
    speed_mps: NDArray[np.float32]
    accuracy_m: NDArray[np.float32]
    line: int


@dataclass(slots=True)
class _Waiting:
    """The rows of a drive that is not over yet, and what came out of it already."""

    parts: list[Rows] = field(default_factory=list)
    count: int = 0
    until_s: float = -np.inf
    given: int = 0


class Assembler:
    """Takes blocks of one file's rows and gives drives as soon as they are whole."""

    def __init__(
        self, labels: Labels, account: Account, *, waiting_rows: int = MOST_WAITING_ROWS
    ) -> None:
        self._labels = labels
        self._account = account
        self._most = waiting_rows
        self._waiting: dict[int, _Waiting] = {}
        self._count = 0
        self._cells: list[str] = []
        self._drives: list[DriveLabel] = []

    def add(self, rows: Rows) -> Iterator[Drive]:
        """Take a block in; the drives that are over by it."""
        if not len(rows):
            return
        present = np.unique(rows.drive).tolist()
        for number in present:
            mine = rows if len(present) == 1 else rows.take(rows.drive == number)
            one = self._waiting.setdefault(number, _Waiting())
            one.parts.append(mine)
            one.count += len(mine)
        self._count += len(rows)
        if self._count > self._most:
            yield from self._relieve(set(present))

    def finish(self) -> Iterator[Drive]:
        """Everything that still waits."""
        for number in list(self._waiting):
            yield from self._give(number, keep_last=False)

    def _relieve(self, touched: set[int]) -> Iterator[Drive]:
        """First the drives that rest; if half of the room is still taken, what others can spare."""
        for number in [each for each in self._waiting if each not in touched]:
            yield from self._give(number, keep_last=False)
        for number in sorted(touched, key=lambda each: -self._waiting[each].count):
            if self._count <= self._most // 2:
                return
            yield from self._give(number, keep_last=True)

    def _give(self, number: int, *, keep_last: bool) -> Iterator[Drive]:
        """The drives among a label's rows; the last stays when it may go on and others went."""
        one = self._waiting[number]
        if not one.parts:
            return
        rows = Rows.join(one.parts)
        self._count -= len(rows)
        one.parts, one.count = [], 0
        late = rows.time_s <= one.until_s
        if late.any():
            self._account.drop(reasons.OUT_OF_ORDER, rows.line[late])
            rows = rows.take(~late)
        stretches = self._stretches(rows, named=self._label(number).name is not None)
        if keep_last and len(stretches) > 1:
            last = rows.take(stretches.pop())
            one.parts, one.count = [last], len(last)
            self._count += len(last)
        elif keep_last:
            self._account.note("drives cut into parts, because they are longer than memory allows")
        for stretch in stretches:
            one.until_s = max(one.until_s, float(rows.time_s[stretch[-1]]))
            yield from self._pieces(number, one, rows.take(stretch))

    def _stretches(self, rows: Rows, *, named: bool) -> list[Indices]:
        """Row numbers of each drive in the order of time, cut at clock steps, gaps and jumps."""
        runs = runs_in_time(rows.time_s, rows.lon, rows.lat) if len(rows) else []
        if len(runs) > 1:
            self._account.note("drives cut where the clock was set back", len(runs) - 1)
        stretches = []
        for run in runs:
            jumps = steps_m(rows.lon[run], rows.lat[run]) > JUMP_M
            if not named:
                jumps |= np.diff(rows.time_s[run]) > DRIVE_GAP_S
            stretches += np.split(run, np.flatnonzero(jumps) + 1)
        return stretches

    def _pieces(self, number: int, one: _Waiting, rows: Rows) -> Iterator[Drive]:
        dropped: Counter[str] = Counter()
        rows, sample = self._samples(rows, dropped)
        count = int(sample[-1]) + 1
        cells = int(np.unique(rows.cell).size)
        most = max(LEAST_SAMPLES, MOST_TRACE_VALUES // cells)
        pieces = -(-count // most)
        for first in range(0, count, -(-count // pieces)):
            part = slice(*np.searchsorted(sample, [first, first + -(-count // pieces)]))
            drive = self._drive(number, one, rows.take(part), sample[part] - first, dropped)
            dropped = Counter()  # counted with the first piece
            if drive is not None:
                yield drive

    def _samples(self, rows: Rows, dropped: Counter[str]) -> tuple[Rows, Indices]:
        """Rows without repeats, and the number of the sample that each belongs to."""
        begins = np.concatenate([[True], np.diff(rows.time_s) > 0.0])
        first = np.flatnonzero(begins)[np.cumsum(begins) - 1]
        elsewhere = (rows.lon != rows.lon[first]) | (rows.lat != rows.lat[first])
        if elsewhere.any():
            self._leave_out(reasons.REPEATED_TIME, rows, elsewhere, dropped)
            rows, begins = rows.take(~elsewhere), begins[~elsewhere]
        sample = np.cumsum(begins) - 1
        place = sample * (int(rows.cell.max()) + 1) + rows.cell
        again = np.ones(len(rows), bool)
        again[np.unique(place, return_index=True)[1]] = False
        if again.any():
            self._leave_out(reasons.REPEATED_READING, rows, again, dropped)
            rows, sample = rows.take(~again), sample[~again]
        stale = repeated_neighbours(rows, sample)
        if stale.any():
            self._leave_out(reasons.REPEATED_NEIGHBOURS, rows, stale, dropped)
            rows, sample = rows.take(~stale), sample[~stale]
        return rows, sample

    def _leave_out(
        self, reason: str, rows: Rows, which: NDArray[np.bool_], dropped: Counter[str]
    ) -> None:
        self._account.drop(reason, rows.line[which])
        dropped[reason] += int(np.count_nonzero(which))

    def _drive(
        self, number: int, one: _Waiting, rows: Rows, sample: Indices, dropped: Counter[str]
    ) -> Drive | None:
        """One trace, its cells in the order of their names; None when it is too short."""
        count = int(sample[-1]) + 1
        if count < LEAST_SAMPLES:
            self._account.drop(reasons.TOO_FEW_SAMPLES, rows.line)
            return None
        one.given += 1
        self._account.samples += count
        self._account.drives += 1
        begins = np.flatnonzero(np.diff(sample, prepend=-1))
        trace = self._trace(number, rows, sample, begins)
        label = self._label(number)
        name = label.name or label.device or "drive"
        return Drive(
            name=name if one.given == 1 else f"{name}/{one.given}",
            trace=trace,
            dropped=dropped,
            speed_mps=rows.speed_mps[begins],
            accuracy_m=rows.accuracy_m[begins],
            line=int(rows.line[0]),
        )

    def _trace(self, number: int, rows: Rows, sample: Indices, begins: Indices) -> Trace:
        heard = np.unique(rows.cell)
        if len(self._cells) != len(self._labels.cells):
            self._cells = list(self._labels.cells)
        heard = heard[np.argsort([self._cells[cell] for cell in heard.tolist()])]
        column = np.zeros(int(heard.max()) + 1, np.intp)
        column[heard] = np.arange(len(heard))
        rsrp_dbm = np.full((len(begins), len(heard)), np.nan, np.float32)
        rsrp_dbm[sample, column[rows.cell]] = rows.rsrp_dbm
        start_s = float(rows.time_s[0])
        known = start_s >= EPOCH_LEAST_S
        cells = tuple(self._cells[cell] for cell in heard.tolist())
        ids = self._labels.global_ids
        return Trace(
            cells=cells,
            time_s=rows.time_s[begins] - start_s,
            lon=rows.lon[begins],
            lat=rows.lat[begins],
            rsrp_dbm=rsrp_dbm,
            device=self._label(number).device,
            recorded_at=datetime.fromtimestamp(start_s, UTC) if known else None,
            global_ids={cell: ids[cell] for cell in cells if cell in ids},
        )

    def _label(self, number: int) -> DriveLabel:
        if len(self._drives) != len(self._labels.drives):
            self._drives = list(self._labels.drives)
        return self._drives[number]
