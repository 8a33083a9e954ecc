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
from typing import BinaryIO

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


def names_of(line: str, delimiter: str) -> tuple[str, ...]:
    """Column names of a header line, lower case, without quotes and spaces."""
    parts = next(csv.reader([line.strip("\ufeff\r\n")], delimiter=delimiter), [])
    return tuple(part.strip().lower() for part in parts)


def read_blocks(
    source: BinaryIO, layout: Layout, wanted: Sequence[str], account: Account
) -> Iterator[Block]:
    """
    The rows after the header, in blocks; rows of another length are dropped by line.

    One value more than names is right when it is empty: some tools end each row with a delimiter.

    Raises:
        WrongFile: A wanted column stands twice.
        BrokenFile: A quote is never closed, or the file cannot be read on.
    """
    places = layout.wanted(wanted)
    for _ in range(layout.header_line):
        source.readline()
    text = io.TextIOWrapper(source, encoding="utf-8", errors="replace", newline="")
    try:
        reader = csv.reader(text, delimiter=layout.delimiter)
        while True:
            block = _next_block(reader, layout, places, account)
            if block is None:
                return
            yield block
    finally:
        text.detach()  # the source is its opener's to close


def _next_block(
    reader: Iterator[list[str]], layout: Layout, places: dict[str, int], account: Account
) -> Block | None:
    width = len(layout.names)
    lines: list[int] = []
    rows: list[list[str]] = []
    wrong: list[int] = []
    ended = True
    line = layout.header_line
    try:
        for row in itertools.islice(reader, BLOCK_ROWS):
            ended = False
            line = layout.header_line + reader.line_num  # type: ignore[attr-defined]
            if len(row) == width or (len(row) == width + 1 and not row[-1]):
                lines.append(line)
                rows.append(row)
            elif row:
                wrong.append(line)
    except csv.Error as error:
        raise BrokenFile(f"line {line + 1}: no table: {error}", f"/lines/{line + 1}") from error
    if ended:
        return None
    account.rows += len(rows) + len(wrong)
    account.drop(WRONG_COLUMNS, wrong)
    columns = {name: encode([row[at] for row in rows]) for name, at in places.items()}
    return Block(np.array(lines, np.int64), columns)


def encode(texts: list[str]) -> Column:
    """Texts as codes of the distinct ones, in the order of their first row."""
    known: dict[str, int] = {}
    codes = np.fromiter(
        (known.setdefault(text, len(known)) for text in texts), np.int32, len(texts)
    )
    return Column(codes, list(known))
