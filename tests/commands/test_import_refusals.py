"""`roadprint import` of what is no file of drives: a sentence, never a traceback."""

from __future__ import annotations

import gzip

import pytest

LOG = "time_s,lat,lon,cell_id,rsrp_dbm\n" + "".join(
    f"{i},{48 + 1e-4 * i:.4f},11.5,850:7,{-90 - i % 9}\n" for i in range(60)
)


@pytest.mark.parametrize(
    ("raw", "complaint"),
    [
        (b"<!DOCTYPE html><html>404", "web page"),
        (LOG.encode("utf-16"), "save it as UTF-8"),
        (gzip.compress(LOG.encode())[:200], "gzip is broken"),
        (gzip.compress(gzip.compress(LOG.encode())), "packed twice"),
        (b"PK\x03\x04" + bytes(90), "zip archive"),
        (bytes(range(1, 256)), "header of no known table"),
        (LOG.splitlines()[0].encode(), "no rows"),
        (b"", "empty"),
    ],
)
def test_what_is_no_file_of_drives_is_called_by_its_name(run, tmp_path, raw, complaint):
    """No traceback, whatever the bytes."""
    path = tmp_path / "drives.csv"
    path.write_bytes(raw)
    done = run("import", path, "--data", tmp_path / "store", "--no-build")
    assert done.exit_code == 1
    assert complaint in " ".join(done.stderr.split())
