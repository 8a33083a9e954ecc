"""
Delimited text as blocks of columns, each a code a row and the distinct texts behind the codes.

Most texts of a drive test repeat from row to row, so that parsing the distinct ones costs a tenth.
This reader is the definition; `arrow_table` is its fast twin for large comma-separated files.
"""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from app.formats.account import WRONG_COLUMNS, Account, BrokenFile, WrongFile

BLOCK_ROWS = 20_000  # some 10 MB of Python texts
MOST_HEADER_BYTES = 1 << 20  # of one line: a table's header is never that long


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """``values[codes[i]]`` is the text of row ``i``."""

    codes: NDArray[np.int32]
    values: Sequence[str]

    def numbers(self, parse: Callable[[str], float]) -> NDArray[np.float64]:
        """Each row's text parsed; ``parse`` sees each distinct text once."""
        return np.array([parse(text) for text in self.values], np.float64)[self.codes]

    def texts(self) -> list[str]:
        """Each row's text."""
        values = self.values
        return [values[code] for code in self.codes.tolist()]


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Some rows of a table: their lines, and the columns by lower-case name."""

    lines: NDArray[np.int64]
    columns: dict[str, Column]

    def __len__(self) -> int:
        return len(self.lines)

    def numbers(self, name: str, parse: Callable[[str], float]) -> NDArray[np.float64]:
        """A column's numbers; NaN all the way when the table lacks it."""
        if name not in self.columns:
            return np.full(len(self), np.nan)
        return self.columns[name].numbers(parse)

    def texts(self, name: str) -> list[str | None]:
        """A column's texts; None all the way when the table lacks it."""
        if name not in self.columns:
            return [None] * len(self)
        return list(self.columns[name].texts())


@dataclass(frozen=True, slots=True)
class Layout:
    """
    How a table is written.

    Attributes:
        names: Lower-case column names in the file's order.
        delimiter: Between values.
        header_line: Line of the header, from 1; rows follow it.
    """

    names: tuple[str, ...]
    delimiter: str
    header_line: int

    def wanted(self, names: Sequence[str]) -> dict[str, int]:
        """
        Where the columns stand, of those names that are there.

        Raises:
            WrongFile: One of them stands twice.
        """
        for name in names:
            if self.names.count(name) > 1:
                raise WrongFile(f"the column {name!r} stands twice", f"/lines/1/{name}")
        return {name: self.names.index(name) for name in names if name in self.names}


class Text(io.TextIOWrapper):
    """A source as text. It stays open: closing it is its opener's part, whenever that comes."""

    def __init__(self, source: BinaryIO, newline: str | None = None) -> None:
        super().__init__(source, encoding="utf-8", errors="replace", newline=newline)

    def close(self) -> None:
        """Nothing."""


def names_of(line: str, delimiter: str) -> tuple[str, ...]:
    """Column names of a header line, lower case, without quotes; ``Cell ID`` is ``cell_id``."""
    parts = next(csv.reader([line.strip("\ufeff\r\n")], delimiter=delimiter), [])
    return tuple(map(_name, parts))


def _name(text: str) -> str:
    return "_".join(text.lower().split())


def read_blocks(
    source: BinaryIO, layout: Layout, wanted: Sequence[str], account: Account
) -> Iterator[Block]:
    """
    The rows after the header, in blocks; rows of another length are dropped by line, blank ones
    are skipped.

    More values than names are right when they are empty: some tools end each row with a delimiter.

    Raises:
        WrongFile: A wanted column stands twice.
        BrokenFile: A quote is never closed, or the file cannot be read on.
    """
    places = layout.wanted(wanted)
    for _ in range(layout.header_line):
        source.readline()
    reader = csv.reader(Text(source, newline=""), delimiter=layout.delimiter)
    width = len(layout.names)
    while True:
        taken = _take(reader, layout.header_line, width)
        account.rows += len(taken.wrong)
        account.drop(WRONG_COLUMNS, taken.wrong)
        columns = {name: encode([row[at] for row in taken.rows]) for name, at in places.items()}
        yield without_blanks(Block(np.array(taken.lines, np.int64), columns), account)
        if taken.broken is not None:
            raise taken.broken
        if taken.ended:
            return


@dataclass(slots=True)
class _Taken:
    """Some rows as they were read: right ones with their lines, lines of wrong ones."""

    rows: list[list[str]]
    lines: list[int]
    wrong: list[int]
    ended: bool = False
    broken: BrokenFile | None = None


def _take(reader: Any, header_line: int, width: int) -> _Taken:
    """The next rows; what was read before a break is kept."""
    taken = _Taken([], [], [])
    line = header_line
    count = 0
    try:
        for row in itertools.islice(reader, BLOCK_ROWS):
            count += 1
            line = header_line + reader.line_num
            if len(row) == width or (len(row) > width and not any(row[width:])):
                taken.lines.append(line)
                taken.rows.append(row)
            elif row:
                taken.wrong.append(line)
    except csv.Error as error:
        taken.broken = BrokenFile(f"no table after line {line}: {error}", f"/lines/{line + 1}")
    taken.ended = count < BLOCK_ROWS
    return taken


def without_blanks(block: Block, account: Account) -> Block:
    """The rows in which any wanted column says something and that are no header again."""
    blank = np.ones(len(block), bool)
    for column in block.columns.values():
        empty = np.array([not text for text in column.values], bool)
        blank &= empty[column.codes] if empty.any() else False
        if not blank.any():
            break
    header = np.ones(len(block), bool)
    for name, column in sorted(block.columns.items(), key=lambda each: len(each[1].values)):
        same = np.array([_name(text) == name for text in column.values], bool)
        header &= same[column.codes] if same.any() else False
        if not header.any():
            break
    if header.any():
        account.note("header lines between the rows left out", int(np.count_nonzero(header)))
        blank |= header
    account.rows += int(np.count_nonzero(~blank))
    if not blank.any():
        return block
    columns = {
        name: Column(column.codes[~blank], column.values) for name, column in block.columns.items()
    }
    return Block(block.lines[~blank], columns)


def encode(texts: list[str]) -> Column:
    """Texts as codes of the distinct ones, in the order of their first row."""
    known: dict[str, int] = {}
    codes = np.fromiter(
        (known.setdefault(text, len(known)) for text in texts), np.int32, len(texts)
    )
    return Column(codes, list(known))
