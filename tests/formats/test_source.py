"""Files on disk: packed or not, whole or cut."""

from __future__ import annotations

import gzip

import pytest

from app.formats.account import Account, BrokenFile
from app.formats.options import Options
from app.formats.read import read_drives
from app.formats.sniff import sniff
from app.formats.source import open_source

from . import samples

LONG = "time_s,lon,lat,cell_id,rsrp_dbm\n" + "".join(
    f"{i},11.0,{48.0 + 1e-5 * i:.5f},850:{i % 7},{-60 - i % 71}\n" for i in range(30_000)
)


def read_file(path, *, keep_going=False, fast=False):
    account = Account()
    with open_source(path) as (source, _):
        options = Options(fast=fast)
        return list(
            read_drives(source, sniff(source), options, account, keep_going=keep_going)
        ), account


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("name", samples.ALL)
def test_gzip_is_found_by_content(tmp_path, name, packed):
    """A name says nothing."""
    path = tmp_path / "log.txt"
    raw = samples.ALL[name].encode()
    path.write_bytes(gzip.compress(raw) if packed else raw)
    assert read_file(path)[1].samples == 4


@pytest.mark.parametrize("fast", [False, True])
def test_a_gzip_cut_short_is_read_to_its_last_row_on_demand(tmp_path, fast):
    """Nothing of it otherwise."""
    path = tmp_path / "log.csv.gz"
    whole = gzip.compress(LONG.encode())
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(BrokenFile, match="gzip"):
        read_file(path, fast=fast)
    _, account = read_file(path, keep_going=True, fast=fast)
    assert 5_000 < account.samples < 30_000
    assert any("gzip" in note for note in account.notes)
