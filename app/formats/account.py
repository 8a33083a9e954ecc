"""What became of a file's rows, and how a file is refused."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from app.errors import Fault, InvalidInput

SHOWN_LINES = 5  # of each reason: enough to find the pattern in an editor

NOT_LTE_OR_NR = "not LTE or NR"
NO_LEVEL = "no level"
FILLER = "filler"
OUT_OF_RANGE = "out of range"
UNKNOWN_UNIT = "unknown unit"
NO_CELL = "no cell"
NO_TIME = "no time"
NO_POSITION = "no position"
INACCURATE = "position too inaccurate"
REPEATED_TIME = "repeated time"
REPEATED_READING = "repeated reading"
REPEATED_NEIGHBOURS = "neighbours not measured anew"
TOO_FEW_SAMPLES = "too few samples in a row"
OUT_OF_ORDER = "time goes back too far"
NOT_A_NUMBER = "not a number"
NOT_A_TIME = "not a time"
POSITION_OUT_OF_RANGE = "position out of range"
SWAPPED = "lon and lat look swapped"
WRONG_COLUMNS = "wrong number of columns"
NOT_A_RECORD = "not a record of this format"

FAULTS = frozenset(
    {
        NOT_A_NUMBER,
        NOT_A_TIME,
        UNKNOWN_UNIT,
        POSITION_OUT_OF_RANGE,
        SWAPPED,
        WRONG_COLUMNS,
        NOT_A_RECORD,
    }
)
"""Reasons that say a file is broken; the others are what sound files of these tools hold too."""


class WrongFile(InvalidInput):
    """The file is none that can be imported; the message says why."""

    code = "wrong-file"
    title = "The file cannot be imported"

    def __init__(self, reason: str, pointer: str = "") -> None:
        super().__init__([Fault(pointer, reason)])
        self.reason = reason

    def __str__(self) -> str:
        """The reason alone: whoever prints it names the file."""
        return self.reason


class EmptyFile(WrongFile):
    """The file is sound and no drive came of it; the message says where its rows went."""

    code = "empty-file"
    title = "No drive is in the file"


class BrokenFile(WrongFile):
    """The file was sound up to a place and cannot be read on from there."""

    code = "broken-file"
    title = "The file is broken"


@dataclass(slots=True)
class Account:
    """
    What became of a file's rows.

    Attributes:
        rows: Rows (records, placemarks, cells of a report) read.
        samples: Samples made of them.
        drives: Drives made of those.
        dropped: Rows left out, by reason.
        lines: The first `SHOWN_LINES` line numbers of each reason (records are counted from 1
            where a format has no lines).
        notes: What else is worth saying: assumed zones, cut drives.
    """

    rows: int = 0
    samples: int = 0
    drives: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    lines: dict[str, list[int]] = field(default_factory=dict)
    notes: Counter[str] = field(default_factory=Counter)

    @property
    def faults(self) -> int:
        """Rows that only a broken file has."""
        return sum(self.dropped[reason] for reason in FAULTS)

    def drop(self, reason: str, lines: NDArray[np.int64] | Sequence[int]) -> None:
        """Count rows left out, of which the first few are remembered by line."""
        if len(lines) == 0:
            return
        self.dropped[reason] += len(lines)
        first = self.lines.setdefault(reason, [])
        first.extend(int(line) for line in lines[: SHOWN_LINES - len(first)])

    def note(self, sentence: str, count: int = 1) -> None:
        """Say something once, however often it happens."""
        self.notes[sentence] += count

    def merge(self, other: Account) -> None:
        """Add another file's account; line numbers stay those of the first file that has some."""
        self.rows += other.rows
        self.samples += other.samples
        self.drives += other.drives
        self.dropped.update(other.dropped)
        self.notes.update(other.notes)
        for reason, lines in other.lines.items():
            self.lines.setdefault(reason, lines)

    def places(self, reason: str) -> str:
        """The first lines of a reason, as a person reads them."""
        lines = self.lines.get(reason, [])
        more = ", ..." if lines and self.dropped[reason] > len(lines) else ""
        return ", ".join(map(str, lines)) + more

    def summary(self) -> str:
        """All drops in one sentence."""
        told = [self.sentence(reason) for reason, _ in self.dropped.most_common()]
        return "; ".join(told) or "no rows"

    def sentence(self, reason: str) -> str:
        """One reason with its count and its first lines."""
        count = self.dropped[reason]
        return f"{count} {'row' if count == 1 else 'rows'}: {reason} (line {self.places(reason)})"


def refuse_if_broken(account: Account) -> None:
    """
    Ends the reading of a file that must be sound.

    Raises:
        BrokenFile: Rows were dropped that no sound file has; each reason is a fault of its own.
    """
    if not account.faults:
        return
    reasons = [reason for reason in account.dropped if reason in FAULTS]
    told = [account.sentence(each) for each in reasons]
    error = BrokenFile("; ".join(told))
    error.faults = [
        Fault(f"/lines/{account.lines[each][0]}", sentence)
        for each, sentence in zip(reasons, told, strict=True)
    ]
    raise error
