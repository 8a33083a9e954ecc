"""Data sets on disk: what is written is read back, and broken ones are refused with the place."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from app.domain import Direction
from app.evaluation.dataset import (
    INDEX,
    PASSES,
    ROADS,
    BadDataset,
    is_dataset,
    read_index,
    read_roads,
    stream_passes,
    write_dataset,
)
from app.evaluation.scenario import build_city, preset
from app.evaluation.simulated import city_passes
from app.formats.account import Account
from app.numerics.geodesy import distance_m

CITY = build_city(preset("paper"), 11)


@pytest.fixture
def folder(tmp_path):
    write_dataset(tmp_path, (truth.road for truth in CITY.roads), city_passes(CITY))
    return tmp_path


def test_what_is_written_is_read_back(folder):
    """Roads, roles and directions, every reading, positions within 2 mm, times within 1 ms."""
    assert is_dataset(folder)
    for road, truth in zip(read_roads(folder), CITY.roads, strict=True):
        assert road.road_id == truth.road_id
        np.testing.assert_allclose(road.line.lon, truth.line.lon, atol=1e-9)
    index = read_index(folder)
    account = Account()
    for read, (entry, trace) in zip(stream_passes(folder, account), city_passes(CITY), strict=True):
        assert index[read.pass_id] == entry
        assert read.trace.recorded_at == trace.recorded_at
        np.testing.assert_allclose(read.trace.time_s, trace.time_s, atol=1.1e-3)
        away_m = distance_m(read.trace.lon, read.trace.lat, trace.lon, trace.lat)
        assert away_m.max() < 2e-3
        columns = [trace.cells.index(cell) for cell in read.trace.cells]
        np.testing.assert_array_equal(read.trace.rsrp_dbm, trace.rsrp_dbm[:, columns])
    assert account.dropped.total() == 0
    roles = [(entry.role, entry.direction) for entry in index.values()]
    assert roles[:4] == 4 * [("survey", Direction.FORWARD)]
    assert roles[4:6] == [("test", Direction.FORWARD), ("test", Direction.BACKWARD)]


def test_same_city_same_bytes(folder, tmp_path_factory):
    """Neither the clock nor the folder's name enters the files."""
    other = tmp_path_factory.mktemp("other")
    write_dataset(other, (truth.road for truth in CITY.roads), city_passes(CITY))
    for name in (ROADS, INDEX, PASSES):
        assert (other / name).read_bytes() == (folder / name).read_bytes()


def test_a_file_cut_short_is_refused(folder):
    """A gzip that ends early is no data set, however much of it can be read."""
    whole = (folder / PASSES).read_bytes()
    (folder / PASSES).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(BadDataset, match=PASSES):
        list(stream_passes(folder, Account()))


def test_a_file_that_is_no_gzip_is_refused(folder):
    """Plain text under the packed name is named, not crashed over."""
    (folder / PASSES).write_bytes(gzip.decompress((folder / PASSES).read_bytes()))
    with pytest.raises(BadDataset, match=PASSES):
        list(stream_passes(folder, Account()))


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        (ROADS, "no json", ROADS),
        (ROADS, '{"features": [{"geometry": {"type": "Point"}}]}', ROADS),
        (INDEX, "pass_id,role\na,survey\n", f"{INDEX}:2"),
        (INDEX, "pass_id,road_id,role,direction\na,r,survey,sideways\n", "sideways"),
        (INDEX, "pass_id,road_id,role,direction\na,r,spare,forward\n", "spare"),
    ],
)
def test_broken_files_are_named(folder, name, content, complaint):
    """The refusal says which file, which line and which value."""
    (folder / name).write_text(content)
    with pytest.raises(BadDataset, match=complaint):
        (read_roads if name == ROADS else read_index)(folder)


def test_a_folder_without_the_files_is_none(tmp_path):
    """All three files make a data set."""
    (tmp_path / ROADS).write_text("{}")
    assert not is_dataset(tmp_path)
