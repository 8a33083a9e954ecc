"""
`table.read_blocks` by Arrow's CSV reader: the same blocks some ten times as fast.

For large comma-separated files only. Values with line breaks within quotes are dropped by line
here; the plain reader takes them.
"""

from __future__ import annotations

import bisect
import csv
from collections.abc import Iterator, Sequence
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from app.formats.account import WRONG_COLUMNS, Account, BrokenFile
from app.formats.table import Block, Column, Layout, encode, without_blanks

BLOCK_BYTES = 1 << 20  # some 15,000 rows; Arrow reads several ahead


def read_blocks_fast(
    source: BinaryIO, layout: Layout, wanted: Sequence[str], account: Account
) -> Iterator[Block]:
    """
    What `app.formats.table.read_blocks` gives, in other block lengths.

    Raises:
        WrongFile: A wanted column stands twice.
        BrokenFile: The file cannot be read on.
    """
    import pyarrow as pa  # noqa: PLC0415 - 100 MB that a serving process must not load
    from pyarrow import csv as arrow_csv  # noqa: PLC0415 - the same

    places = layout.wanted(wanted)
    for _ in range(layout.header_line):
        source.readline()
    lines = _Lines(layout.header_line, len(layout.names))
    text = pa.dictionary(pa.int32(), pa.binary())  # bytes: a wrong letter must not end the reading
    reader = None
    try:
        reader = arrow_csv.open_csv(
            pa.PythonFile(source, mode="r"),
            read_options=arrow_csv.ReadOptions(
                use_threads=False,
                block_size=BLOCK_BYTES,
                column_names=[str(i) for i in range(len(layout.names))],
            ),
            parse_options=arrow_csv.ParseOptions(
                delimiter=layout.delimiter,
                ignore_empty_lines=False,  # they count as lines
                invalid_row_handler=lines.skip,
            ),
            convert_options=arrow_csv.ConvertOptions(
                column_types={str(at): text for at in places.values()},
                include_columns=[str(at) for at in places.values()],
                strings_can_be_null=False,
            ),
        )
        for batch in reader:
            yield _block(batch, places, lines, account)
            yield from lines.salvaged(layout.delimiter, places, account)
    except pa.ArrowInvalid as error:
        if "Empty CSV file" not in str(error):
            raise BrokenFile(f"no table: {error}") from error
    yield from lines.salvaged(layout.delimiter, places, account)
    account.rows += len(lines.wrong)
    account.drop(WRONG_COLUMNS, lines.wrong)


def _block(batch: Any, places: dict[str, int], lines: _Lines, account: Account) -> Block:
    columns = {
        name: _column(batch.column(place)) for place, name in enumerate(places)
    }  # include_columns gives them in this order
    return without_blanks(Block(lines.take(batch.num_rows), columns), account)


def _column(array: Any) -> Column:
    values = [each.decode("utf-8", "replace") for each in array.dictionary.to_pylist()]
    return Column(array.indices.to_numpy(zero_copy_only=False), values)


class _Lines:
    """Which line each row stands on: the reader tells only which lines were no rows."""

    def __init__(self, header_line: int, width: int) -> None:
        self.header_line = header_line
        self.width = width
        self.wrong: list[int] = []
        self._long: list[tuple[int, str]] = []
        self._skipped: list[int] = []
        self._next = header_line + 1

    def skip(self, row: Any) -> str:
        """Arrow's handler of rows of another length; empty lines are no rows and no fault."""
        line = self.header_line + row.number
        self._skipped.append(line)
        if row.actual_columns > row.expected_columns:
            self._long.append((line, row.text))
        elif row.text:
            self.wrong.append(line)
        return "skip"

    def salvaged(self, delimiter: str, places: dict[str, int], account: Account) -> Iterator[Block]:
        """Rows with values too many that are empty: right ones, as some tools write them."""
        rows = {
            line: next(csv.reader([text], delimiter=delimiter), [""]) for line, text in self._long
        }
        self._long.clear()
        long = {
            line: any(row[self.width :]) or len(row) <= self.width for line, row in rows.items()
        }
        self.wrong += [line for line, wrong in long.items() if wrong]
        right = {line: row for line, row in rows.items() if not long[line]}
        if right:
            columns = {
                name: encode([row[at] for row in right.values()]) for name, at in places.items()
            }
            yield without_blanks(Block(np.array(list(right), np.int64), columns), account)

    def take(self, count: int) -> NDArray[np.int64]:
        """The lines of the next ``count`` rows."""
        lines = np.arange(self._next, self._next + count, dtype=np.int64)
        low = bisect.bisect_left(self._skipped, self._next)
        for line in self._skipped[low:]:
            if count == 0 or line > lines[-1]:
                break
            lines[np.searchsorted(lines, line) :] += 1
        if count:
            self._next = int(lines[-1]) + 1
        return lines
