"""`roadprint doctor`: every kind of file and folder, in words, and what it ends with."""

from __future__ import annotations

import gzip
import shutil
from pathlib import Path

import pytest

from tests.formats import samples

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
START_S = 1_620_468_000.0  # 2021-05-08T10:00:00Z
DAY_S = 86_400.0


def words(text: str) -> str:
    """Without the breaks of lines."""
    return " ".join(text.split())


def tidy(
    *, days: int = 1, cells: int = 2, decimals: int = 7, back: bool = False, dated: bool = True
):
    """A kilometre to the north at 10 m/s, once a day, as tidy rows."""
    rows = ["trace_id,time_s,lon,lat,cell_id,rsrp_dbm"]
    for day in range(days):
        for i in range(100):
            step = 99 - i if back and day % 2 else i
            lat = round(48.1371234 + 9e-5 * step, decimals)
            at = (START_S if dated else 0.0) + day * (DAY_S if dated else 1000.0) + i
            rows += [
                f"drive-{day},{at},11.5754321,{lat},850:{cell},{-90 - i % 30 - cell}"
                for cell in range(cells)
            ]
    return "\n".join(rows) + "\n"


@pytest.fixture
def file(tmp_path):
    return lambda text, name="log.csv": _written(tmp_path / name, text)


def _written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_a_good_file_is_called_good(run, file):
    """Five days, both ways, neighbours: every verdict has its number, and the end is 0."""
    done = run("doctor", file(tidy(days=5, back=True)))
    assert done.exit_code == 0, done.stderr
    told = words(done.stdout)
    assert "tidy: 1 file" in told
    assert "2021-05-08 to 2021-05-12, 5 days" in told
    assert "+ good for finding roads: 100% of 1.0 km of ground were driven again" in told
    assert "of the ground were driven in both directions" in told
    assert "+ 5 days, and 100% of the ground on more than one" in told
    assert "+ 2.0 cells a sample, 2 different: serving and neighbours" in told
    assert "! " not in told
    assert "x " not in told.split("└")[1]


def test_what_is_missing_is_said_with_what_to_do(run, file):
    """One day, once, one way, the serving cell, coarse latitudes."""
    told = words(run("doctor", file(tidy(cells=1, decimals=4))).stdout)
    assert "x one day only: probabilities cannot be tested on another day" in told
    assert "-> come back on another day" in told
    assert "! 100% of 1.0 km of ground were driven only once" in told
    assert "! 0% of the ground were driven in both directions" in told
    assert "! serving cell only (100% of samples hear one cell): expect tens of metres" in told
    assert "! latitude is rounded to 11 m (4 decimals)" in told


def test_undated_drives_are_one_day(run, file):
    """Relative times tell no day."""
    told = words(run("doctor", file(tidy(days=3, dated=False))).stdout)
    assert "none of the 3 drives has a date" in told
    assert "without dates" in told


def test_days_on_different_ground_test_nothing(run, file):
    """Two towns on two days have no day to hold out."""
    other = tidy(days=2).replace("drive-1", "there")
    moved = "\n".join(
        row.replace("11.5754321", "11.6754321") if row.startswith("there") else row
        for row in other.split("\n")
    )
    told = words(run("doctor", file(moved)).stdout)
    assert "x 2 days, but on different ground (0% in common)" in told


def test_broken_rows_are_named_and_left_out(run, file):
    """With their lines, and what importing them takes; the doctor still ends with 0."""
    text = tidy(days=2) + "drive-9,what,11.5,48.1,850:1,-90\n"
    done = run("doctor", file(text))
    assert done.exit_code == 0
    told = words(done.stdout)
    assert "x 1 rows are broken: not a time: 1 (line 402)" in told
    assert "--keep-going" in told


def test_fillers_are_counted(run, file):
    """Levels that tools write for nothing."""
    text = tidy(days=2).replace(",-95\n", ",-30.0\n")
    told = words(run("doctor", file(text)).stdout)
    assert "fillers and impossible levels" in told
    assert "left out │ filler:" in told


@pytest.mark.parametrize(
    ("name", "text", "format_"),
    [
        ("a.csv", samples.TIDY, "tidy"),
        ("a.txt", samples.GNETTRACK, "gnettrack"),
    ],
)
def test_every_format_is_read(run, file, name, text, format_):
    """The importers' own samples."""
    done = run("doctor", file(text, name))
    assert done.exit_code == 0, done.stderr
    assert f"{format_}: 1 file" in done.stdout
    assert "only 0.0 km were driven: no map comes of that" in words(done.stdout)


def test_a_folder_is_read_whole_and_strangers_are_named(run, tmp_path):
    """Packed or not, in folders of folders; what is no measurement has its reason."""
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "a.csv.gz").write_bytes(gzip.compress(tidy().encode()))
    _written(tmp_path / "b.csv", tidy(days=2))
    _written(tmp_path / "notes.txt", "nothing to see\n")
    _written(tmp_path / "README.md", "# nothing to say\n")
    done = run("doctor", tmp_path)
    assert done.exit_code == 0
    assert "tidy: 2 files" in done.stdout
    assert "drives │ 3" in words(done.stdout)
    assert "notes.txt: the first line (nothing to see) is the header of no known table" in words(
        done.stderr
    )
    assert "README" not in done.stderr


def test_a_data_set_tells_its_roles(run, dataset, tmp_path):
    """Survey and test passes are told apart; whole drives beside them are left alone."""
    folder = tmp_path / "area"
    shutil.copytree(dataset, folder)
    (folder / "drives.csv.gz").write_bytes(gzip.compress(tidy().encode()))
    done = run("doctor", folder)
    assert done.exit_code == 0, done.stderr
    told = words(done.stdout)
    assert "12 (4 survey, 8 test)" in told
    assert "an index keeps 8 of 12 back for testing" in told
    assert "left alone:" in told


def test_an_index_beside_whole_drives_tells_roles(run, tmp_path):
    """As `roadprint import` reads it."""
    (tmp_path / "drives.csv.gz").write_bytes(gzip.compress(tidy(days=3).encode()))
    _written(tmp_path / "drives_index.csv", "trace_id,role\ndrive-0,survey\ndrive-2,test\n")
    told = words(run("doctor", tmp_path).stdout)
    assert "3 (1 survey, 1 test)" in told


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "{}"])
def test_nothing_readable_ends_with_a_fault(run, file, text):
    """1, with the reason; never a trace of the stack."""
    done = run("doctor", file(text))
    assert done.exit_code == 1
    assert "nothing could be read" in done.stderr
    assert "not read" in done.stderr


def test_wrong_words_end_with_usage(run, file):
    """2: no such file, no such zone."""
    assert run("doctor", "/no/such/file").exit_code == 2
    assert run("doctor", file(tidy()), "--time-zone", "Mars/Base").exit_code == 2


@pytest.mark.real_data
@pytest.mark.skipif(not (DATA / "pcat").is_dir(), reason=f"the measurements are not at {DATA}")
def test_real_drives_are_told_as_they_are(run):
    """One suburban road, fifty times, serving cell only, coarse latitudes, no dates."""
    told = words(run("doctor", DATA / "pcat").stdout)
    assert "50 (40 survey, 10 test)" in told
    assert "serving cell only (100% of samples" in told
    assert "latitude is rounded to 11 m" in told
    assert "none of the 50 drives has a date" in told
    assert "good for finding roads" in told
