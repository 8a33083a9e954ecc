"""Laws of reading: what a drive says does not hang on how its file was written."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.domain import Trace
from app.formats import account as reasons
from app.formats.account import Account, WrongFile
from app.formats.arrow_table import read_blocks_fast
from app.formats.assemble import Assembler
from app.formats.order import runs_in_time
from app.formats.rows import DriveLabel, Labels, Rows
from app.formats.sniff import sniff
from app.formats.table import Block, read_blocks

from . import samples
from .conftest import read_text

LAWS = settings(max_examples=60, deadline=None, derandomize=True)  # the seed is the test's name
COLUMNS = ("time_s", "lon", "lat", "cell_id", "rsrp_dbm")

Row = tuple[float, float, float, str, float]


@st.composite
def drives(draw: st.DrawFn, lat: float | None = None, lon: float | None = None) -> list[Row]:
    """A drive of some seconds at some speed: one row a reading, in the order of time."""
    lat = draw(st.floats(-80, 80)) if lat is None else lat
    lon = draw(st.floats(1, 170)) if lon is None else lon  # 0, 0 is no position
    count = draw(st.integers(3, 12))
    step_deg = draw(st.floats(1e-5, 3e-4))
    rows = []
    for i in range(count):
        cells = draw(st.lists(st.sampled_from("abcd"), min_size=1, max_size=4, unique=True))
        for cell in cells:
            level = draw(st.integers(-140, -44))
            place = (round(lon + i * step_deg, 7), round(lat + i * step_deg, 7))
            rows.append((samples.START_S + i, *place, f"850:{ord(cell)}", float(level)))
    return rows


def table(rows: list[Row], names: tuple[str, ...] = COLUMNS, end: str = "\n") -> str:
    at = [COLUMNS.index(name) for name in names]
    lines = [",".join(names), *(",".join(repr(row[i]).strip("'") for i in at) for row in rows)]
    return end.join(lines) + end


def traces(rows: list[Row], **how: object) -> list[Trace]:
    return [drive.trace for drive in read_text(table(rows, **how)).drives]


def assert_same(first: list[Trace], second: list[Trace]) -> None:
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        assert one.cells == other.cells
        assert one.recorded_at == other.recorded_at
        for name in ("time_s", "lon", "lat", "rsrp_dbm"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@LAWS
@given(drives(), st.randoms(use_true_random=False))
def test_shuffled_rows_are_the_same_drive(rows, random):
    """The order of rows says nothing that their times do not say."""
    shuffled = rows[:]
    random.shuffle(shuffled)
    assert_same(traces(shuffled), traces(rows))


@LAWS
@given(drives(), st.data())
def test_duplicated_rows_change_nothing_and_are_counted(rows, data):
    """Once or five times, next to one another or not."""
    again = data.draw(st.lists(st.sampled_from(rows), max_size=20))
    found = read_text(table(rows + again))
    assert_same([drive.trace for drive in found.drives], traces(rows))
    assert found.account.dropped[reasons.REPEATED_READING] == len(again)


@LAWS
@given(drives(), st.permutations(COLUMNS), st.sampled_from(["\n", "\r\n"]))
def test_columns_are_found_by_name(rows, names, end):
    """In any order, with any line ends."""
    assert_same(traces(rows, names=tuple(names), end=end), traces(rows))


@LAWS
@given(drives(), st.booleans())
def test_mirroring_the_earth_mirrors_the_drive(rows, south):
    """Southern latitudes and western longitudes are read like their mirror images."""
    mirrored = [
        (t, lon if south else -lon, -lat if south else lat, cell, level)
        for t, lon, lat, cell, level in rows
    ]
    (one,), (other,) = traces(rows), traces(mirrored)
    np.testing.assert_array_equal(one.lat, -other.lat if south else other.lat)
    np.testing.assert_array_equal(one.lon, other.lon if south else -other.lon)
    np.testing.assert_array_equal(one.rsrp_dbm, other.rsrp_dbm)


@LAWS
@given(drives(lon=1.0), st.randoms(use_true_random=False))
def test_a_drive_across_the_antimeridian_is_one_drive(rows, random):
    """180 and -180 degrees are one place: no jump, also when rows come shuffled."""

    def moved(lon: float) -> float:
        turned = lon + 179.0 - 4e-4
        return round(turned - 360.0 if turned > 180.0 else turned, 7)

    crossing = [(t, moved(lon), lat, cell, level) for t, lon, lat, cell, level in rows]
    random.shuffle(crossing)
    (trace,) = traces(crossing)
    np.testing.assert_array_equal(trace.rsrp_dbm, traces(rows)[0].rsrp_dbm)


@LAWS
@given(st.integers(8, 30), st.integers(5, 200), st.integers(2, 6))
def test_a_clock_that_is_set_back_cuts_the_drive_and_loses_nothing(count, back_s, cut):
    """The vehicle goes on; its file's order is the truth, not its clock."""
    cut = count * cut // 8
    readings = [
        (samples.START_S + 4 * i - (back_s if i >= cut else 0), 11.0 + 1e-3 * i, 48.0, "a:1", -90.0)
        for i in range(20 * count)
    ]
    found = read_text(table(readings))
    assert found.account.samples == len(readings)
    assert len(found.drives) == 2
    for drive in found.drives:
        assert (np.diff(drive.trace.lon) > 0).all()
    assert any("clock" in note for note in found.account.notes)


def test_a_clock_that_is_set_forward_loses_nothing():
    """A short silence is part of the drive, a long one ends it."""
    for step_s, drives_made in ((200, 1), (400, 2)):
        readings = [
            (samples.START_S + i + (step_s if i >= 10 else 0), 11.0 + 1e-4 * i, 48.0, "a:1", -90.0)
            for i in range(20)
        ]
        found = read_text(table(readings))
        assert (found.account.samples, len(found.drives)) == (20, drives_made)


def test_a_file_sorted_by_cell_is_sorted_by_time():
    """Runs of one cell each are no clock steps, however few they are."""
    count = 100
    time_s = np.tile(np.arange(count, dtype=float), 3)
    lon, lat = 11.0 + 1e-4 * time_s, np.full(3 * count, 48.0)
    (run,) = runs_in_time(time_s, lon, lat)
    assert (np.diff(time_s[run]) >= 0).all()


def test_a_named_drive_is_one_drive_through_its_stops():
    """A file that names its drives is believed; one that does not is cut at long silences."""
    head, *rows = table([(samples.START_S + 1000 * i, 11.0, 48.0 + 1e-4 * i, "a:1", -90.0)
                         for i in range(6)]).splitlines()  # fmt: skip
    named = "\n".join([f"trace_id,{head}", *(f"t{i % 2},{row}" for i, row in enumerate(rows))])
    found = read_text(named)
    assert [(drive.name, len(drive.trace.time_s)) for drive in found.drives] == [
        ("t0", 3),
        ("t1", 3),
    ]
    with pytest.raises(WrongFile, match=reasons.TOO_FEW_SAMPLES):
        read_text("\n".join([head, *rows]))


@LAWS
@given(st.integers(2, 60), st.integers(4, 40), st.integers(1, 3))
def test_memory_is_bounded_and_no_reading_is_lost(block_rows, waiting_rows, drive_count):
    """However little may wait, every reading comes out once, in drives that do not overlap."""
    count = 240
    labels, account = Labels(), Account()
    cell = [labels.cell(key) for key in ("a:1", "b:2")]
    drive = [labels.drive(DriveLabel(name=f"d{k}")) for k in range(drive_count)]
    rng = np.random.default_rng(3)
    rows = Rows(
        line=np.arange(2 * count),
        drive=np.array(drive, np.int32)[rng.integers(0, drive_count, 2 * count)],
        time_s=np.repeat(np.arange(count, dtype=float), 2),
        lon=np.repeat(11.0 + 1e-4 * np.arange(count), 2),
        lat=np.full(2 * count, 48.0),
        speed_mps=np.full(2 * count, np.nan, np.float32),
        accuracy_m=np.full(2 * count, np.nan, np.float32),
        cell=np.tile(np.array(cell, np.int32), count),
        rsrp_dbm=np.full(2 * count, -90.0),
        serving=np.zeros(2 * count, np.int8),
        nr=np.zeros(2 * count, bool),
    )
    assembler = Assembler(labels, account, waiting_rows=waiting_rows)
    found = []
    for first in range(0, 2 * count, block_rows):
        found += assembler.add(rows.take(slice(first, first + block_rows)))
    found += assembler.finish()
    readings = sum(int(np.isfinite(each.trace.rsrp_dbm).sum()) for each in found)
    assert readings + account.dropped.total() == 2 * count
    assert len({each.name for each in found}) == len(found)


ODD_LINES = st.lists(
    st.one_of(
        st.sampled_from(
            ["", "1,2", "1,2,3,4,5,6,7", '1,2,3,"a,b",-90', "x,2,3,a,-90", ",,,,", "1,2,3,a,-90,"]
        ),
        st.tuples(st.floats(0, 9), st.sampled_from("abc")).map(lambda t: f"{t[0]},1,2,{t[1]},-90"),
    ),
    max_size=40,
)


@LAWS
@given(ODD_LINES, st.sampled_from(["\n", "\r\n"]), st.booleans())
def test_the_fast_reader_reads_what_the_plain_one_reads(lines, end, mark):
    """The same lines, texts and drops, whatever stands in the file."""
    text = end.join([",".join(COLUMNS), *lines]) + end
    raw = (b"\xef\xbb\xbf" if mark else b"") + text.encode()
    layout = sniff(io.BytesIO(raw)).layout
    told = []
    for reader in (read_blocks, read_blocks_fast):
        account = Account()
        blocks = list(reader(io.BytesIO(raw), layout, COLUMNS, account))
        told.append((rows_of(blocks), account))
    (plain, fast), (one, other) = zip(*told, strict=True)
    assert plain == sorted(fast)
    assert (one.rows, one.dropped) == (other.rows, other.dropped)
    assert sorted(one.lines) == sorted(other.lines)


def rows_of(blocks: list[Block]) -> list[tuple[object, ...]]:
    return [
        row
        for block in blocks
        for row in zip(
            block.lines.tolist(), *(block.columns[name].texts() for name in COLUMNS), strict=True
        )
    ]


@LAWS
@given(st.floats(-1e9, 1e9) | st.just(math.nan), st.sampled_from(["dBm", "km/h", "", "furlong"]))
def test_a_unit_that_is_not_known_is_never_guessed(value, unit):
    """None of it becomes a number."""
    from app.formats.values import measure

    found = measure(f"{value:.3f} {unit}", {"dBm": 1.0, "": 2.0})
    if math.isnan(value):
        assert found is None or not math.isfinite(found)
    elif unit in {"dBm", ""}:
        assert found == pytest.approx(float(f"{value:.3f}") * (1.0 if unit else 2.0))
    else:
        assert found is None
