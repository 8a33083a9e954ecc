"""Tidy rows become passes, and every row that does not is counted with its reason."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from app.evaluation.tidy import BadTable, read_passes
from app.formats.account import Account

HEADER = "pass_id,timestamp_s,lat,lon,cell_id,rsrp_dbm,serving"


def read(*rows: str, header: str = HEADER):
    account = Account()
    return list(read_passes([header, *rows], account)), account


def test_rows_of_one_time_are_one_sample():
    """Cells become columns in the order of their first row, unheard ones are NaN."""
    passes, account = read(
        "a,1700000000.0,48.1,11.5,1:1,-90.5,1",
        "a,1700000000.0,48.1,11.5,1:2,-101,0",
        "a,1700000001.0,48.2,11.5,1:3,-99,1",
    )
    trace = passes[0].trace
    assert trace.cells == ("1:1", "1:2", "1:3")
    nan = np.nan
    np.testing.assert_array_equal(trace.rsrp_dbm, [[-90.5, -101, nan], [nan, nan, -99]])
    np.testing.assert_array_equal(trace.time_s, [0.0, 1.0])
    assert trace.recorded_at is not None
    assert trace.recorded_at.timestamp() == 1_700_000_000.0
    assert (account.rows, account.samples, account.dropped.total()) == (3, 2, 0)


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("a,5.0,48.1,11.5,1:1,-30.0,1", "filler"),
        ("a,5.0,48.1,11.5,1:1,2147483647,1", "filler"),
        ("a,5.0,48.1,11.5,1:1,127,1", "filler"),
        ("a,5.0,48.1,11.5,1:1,-140.5,1", "out of range"),
        ("a,5.0,48.1,11.5,1:1,-43.9,1", "out of range"),
        ("a,5.0,48.1,11.5,1:1,,1", "no number"),
        ("a,5.0,48.1,11.5,1:1,nan,1", "no number"),
        ("a,5.0,,11.5,1:1,-90,1", "no position"),
        ("a,5.0,91,11.5,1:1,-90,1", "no position"),
        ("a,,48.1,11.5,1:1,-90,1", "no time"),
        ("a,3.0,48.1,11.5,1:1,-90,1", "time goes back"),
        ("a,4.0,48.1,11.5,1:1,-91,1", "repeated reading"),
        ("a,5.0,48.1,11.5,1:1", "wrong number of columns"),
    ],
)
def test_rows_left_out_are_counted_by_reason(row, reason):
    """A row that is no reading changes nothing but its counter."""
    passes, account = read("a,4.0,48.1,11.5,1:1,-90,1", row)
    assert account.dropped == {reason: 1}
    assert len(passes) == 1
    np.testing.assert_array_equal(passes[0].trace.rsrp_dbm, [[-90.0]])


def test_a_pass_without_any_reading_is_none():
    """Nothing but fillers makes no pass."""
    passes, account = read("a,4.0,48.1,11.5,1:1,-30,1", "b,4.0,48.1,11.5,1:1,-90,1")
    assert [each.pass_id for each in passes] == ["b"]
    assert account.dropped == {"filler": 1}


def test_columns_are_found_by_name():
    """In any order, others ignored; a table without pass ids is one pass."""
    passes, _ = read("x,-90,1:1,11.5,48.1,0.5", header="note,rsrp_dbm,cell_id,lon,lat,time_s")
    assert passes[0].pass_id == ""
    assert passes[0].trace.recorded_at is None
    assert float(passes[0].trace.lat[0]) == 48.1


@pytest.mark.parametrize(
    ("lines", "complaint"),
    [
        ([], "empty"),
        (["time_s,lat,cell_id"], "lon, rsrp_dbm"),
        (["lon,lat,cell_id,rsrp_dbm"], "time_s"),
        (
            [HEADER, "a,1,1,1,c,-90,1", "b,1,1,1,c,-90,1", "a,2,1,1,c,-90,1"],
            "a goes on at row 3",
        ),
    ],
)
def test_what_is_no_table_is_refused_with_the_reason(lines, complaint):
    """The message names the missing column or the row."""
    with pytest.raises(BadTable, match=complaint):
        list(read_passes(lines, Account()))


def test_one_pass_is_in_memory_at_a_time():
    """A pass is given out as soon as the next one begins, however long the file goes on."""
    endless = (f"{i // 3},{i}.0,48.1,11.5,1:1,-90,1" for i in itertools.count())
    stream = read_passes(itertools.chain([HEADER], endless), account := Account())
    assert [next(stream).pass_id for _ in range(5)] == ["0", "1", "2", "3", "4"]
    assert account.rows == 16
