"""`roadprint import` on a data folder: what is stored, what is refused, what is told of it."""

from __future__ import annotations

import csv
import gzip
import shutil

import numpy as np
import orjson
import pytest

from app.commands.target import survey_document
from app.evaluation.dataset import INDEX, PASSES
from app.evaluation.scenario import survey
from app.services.roads import get_road
from app.services.surveys import list_surveys, survey_trace
from app.settings import Settings
from app.store.engine import create_store_engine

from .conftest import CITY

TRACE = survey(CITY)[0]


@pytest.fixture
def store(tmp_path):
    return tmp_path / "store"


def stored(folder):
    engine = create_store_engine(Settings(data_dir=folder).store_url)
    surveys = list_surveys(engine, limit=1000).items
    return engine, surveys


def tidy_csv(path, trace=TRACE):
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["time_s", "lon", "lat", "cell_id", "rsrp_dbm"])
        for i, k in zip(*np.nonzero(np.isfinite(trace.rsrp_dbm)), strict=True):
            place = (trace.time_s[i], trace.lon[i], trace.lat[i])
            rows.writerow([*place, trace.cells[k], trace.rsrp_dbm[i, k]])
    return path


def test_a_data_set_is_taken_in_pass_by_pass(run, dataset, store):
    """Roads with their lines, survey passes with every sample; test passes stay out."""
    done = run("import", dataset, "--data", store, "--no-build")
    assert done.exit_code == 0, done.output
    engine, surveys = stored(store)
    assert [survey.roads for survey in surveys] == [(truth.road_id,) for truth in CITY.roads]
    np.testing.assert_allclose(get_road(engine, "road-east").line.lon, CITY.roads[1].line.lon)
    read = survey_trace(engine, surveys[0].survey_id)
    columns = [TRACE.cells.index(cell) for cell in read.cells]
    np.testing.assert_array_equal(read.rsrp_dbm, TRACE.rsrp_dbm[:, columns])
    assert read.recorded_at == TRACE.recorded_at
    for words in ("surveys stored       │ 4", "test passes left out │ 8"):
        assert words in done.stdout


def test_importing_again_stores_nothing(run, dataset, store, tmp_path):
    """Neither from the same folder nor from a copy of another name."""
    copy = shutil.copytree(dataset, tmp_path / "copy")
    run("import", dataset, "--data", store, "--no-build")
    for folder in (dataset, copy):
        again = run("import", folder, "--data", store, "--no-build")
        assert again.exit_code == 0, again.output
        assert "stored by an earlier import │ 4" in again.stdout
    assert len(stored(store)[1]) == 4


def test_a_corrected_file_is_a_new_survey(run, dataset, store, tmp_path):
    """The same names with other content are stored beside what was there."""
    folder = shutil.copytree(dataset, tmp_path / "area")
    run("import", dataset, "--data", store, "--no-build")
    text = gzip.decompress((folder / PASSES).read_bytes()).decode()
    first, second, *rest = text.splitlines(keepends=True)
    changed = second.replace(second.split(",")[5], "-77", 1)
    (folder / PASSES).write_bytes(gzip.compress("".join([first, changed, *rest]).encode()))
    done = run("import", folder, "--data", store, "--no-build")
    assert "stored by an earlier import │ 3" in done.stdout
    assert len(stored(store)[1]) == 5


@pytest.mark.parametrize("packed", [False, True])
def test_a_tidy_csv_is_one_pass_on_the_named_road(run, store, tmp_path, packed):
    """Plain or gzipped, with ``--road-id``."""
    path = tidy_csv(tmp_path / "drive.csv")
    if packed:
        path.write_bytes(gzip.compress(path.read_bytes()))
    done = run("import", path, "--road-id", "high-street", "--data", store, "--no-build")
    assert done.exit_code == 0, done.output
    engine, surveys = stored(store)
    assert surveys[0].roads == ("high-street",)
    heard = np.isfinite(TRACE.rsrp_dbm).any(axis=1)
    assert surveys[0].samples == int(heard.sum())
    assert np.isfinite(survey_trace(engine, surveys[0].survey_id).rsrp_dbm).any()


def test_a_survey_as_json_is_taken_as_the_api_takes_it(run, store, tmp_path):
    """The body of POST /v1/surveys as a file."""
    path = tmp_path / "survey.json"
    path.write_bytes(orjson.dumps(survey_document(TRACE)))
    done = run("import", path, "--data", store, "--no-build")
    assert done.exit_code == 0, done.output
    engine, surveys = stored(store)
    np.testing.assert_array_equal(
        survey_trace(engine, surveys[0].survey_id).rsrp_dbm, TRACE.rsrp_dbm
    )


def test_one_bad_pass_is_refused_alone(run, dataset, store, tmp_path):
    """The others are stored, the refusal is told with its reason, the exit code says so."""
    bad = tmp_path / "bad.json"
    bad.write_bytes(orjson.dumps(survey_document(TRACE) | {"lat": [95.0] * len(TRACE.lat)}))
    done = run("import", bad, dataset, "--data", store, "--no-build")
    assert done.exit_code == 1
    assert "invalid-input" in done.stdout
    assert "/lat/0" in done.stdout
    assert len(stored(store)[1]) == 4


def test_passes_that_the_index_lacks_are_refused(run, dataset, store, tmp_path):
    """A pass without road and role cannot be stored."""
    folder = shutil.copytree(dataset, tmp_path / "area")
    lines = (folder / INDEX).read_text().splitlines(keepends=True)
    (folder / INDEX).write_text("".join(lines[:1] + lines[2:]))
    done = run("import", folder, "--data", store, "--no-build")
    assert done.exit_code == 1
    assert "not-in-index" in done.stdout
    assert len(stored(store)[1]) == 3


def test_a_truncated_data_set_fails_with_the_file(run, dataset, store, tmp_path):
    """What came before the break stays stored; the message names the file."""
    folder = shutil.copytree(dataset, tmp_path / "area")
    whole = (folder / PASSES).read_bytes()
    (folder / PASSES).write_bytes(whole[: len(whole) // 2])
    done = run("import", folder, "--data", store, "--no-build")
    assert done.exit_code == 1
    assert PASSES in done.stderr


@pytest.mark.parametrize("words", [["absent.csv"], ["."]])
def test_what_is_no_survey_file_is_refused_before_anything_happens(
    run, store, tmp_path, monkeypatch, words
):
    """A missing file and a folder that is no data set: exit code 2, no store."""
    monkeypatch.chdir(tmp_path)
    done = run("import", *words, "--data", store)
    assert done.exit_code == 2
    assert words[0] in done.stderr
    assert not store.exists()


def test_a_service_that_is_not_there_is_said_plainly(run, dataset):
    """No trace of Python, one sentence with the address."""
    done = run("import", dataset, "--url", "http://127.0.0.1:9")
    assert done.exit_code == 1
    assert "http://127.0.0.1:9 does not answer" in done.stderr


def test_url_and_folder_exclude_one_another(run, dataset, store):
    """A service has its own folder."""
    done = run("import", dataset, "--url", "http://127.0.0.1:9", "--data", store)
    assert done.exit_code == 2


DRIVES = "trace_id,timestamp_s,lat,lon,speed_mps,cell_id,rsrp_dbm,serving\n" + "".join(
    f"t{k},{1_700_000_000 + 4000 * k + i}.0,{48 + 1e-4 * i:.4f},11.5,,"
    f"850:{7 + j},{-90 - i - j},{1 - j}\n"
    for k in range(3)
    for i in range(20)
    for j in range(2)
)
ROLES = "trace_id,role\nt0,survey\nt1,test\nt2,survey\n"


def drives_file(folder, text=DRIVES, roles=None):
    folder.mkdir(exist_ok=True)
    (folder / "drives.csv.gz").write_bytes(gzip.compress(text.encode()))
    if roles:
        (folder / "drives_index.csv").write_text(roles)
    return folder / "drives.csv.gz"


def test_a_file_of_drives_is_a_survey_a_drive(run, store, tmp_path):
    """Each whole drive with its samples and its time, on no road yet."""
    done = run("import", drives_file(tmp_path / "set"), "--data", store, "--no-build")
    assert done.exit_code == 0, done.output
    engine, surveys = stored(store)
    assert [survey.samples for survey in surveys] == [20, 20, 20]
    assert surveys[0].recorded_at.timestamp() == 1_700_000_000
    trace = survey_trace(engine, surveys[0].survey_id)
    assert trace.cells == ("850:7", "850:8")
    np.testing.assert_array_equal(trace.rsrp_dbm[:, 0], -90.0 - np.arange(20))
    assert "drives.csv.gz: tidy" in done.stdout


@pytest.mark.parametrize(("words", "count"), [([], 2), (["--include-tests"], 3)])
@pytest.mark.parametrize("whole_folder", [True, False])
def test_test_drives_are_left_out_and_said_to_be(run, store, tmp_path, words, count, whole_folder):
    """The index beside the file keeps them for measuring the map, unless they are asked for."""
    path = drives_file(tmp_path / "set", roles=ROLES)
    done = run(
        "import", path.parent if whole_folder else path, "--data", store, "--no-build", *words
    )
    assert done.exit_code == 0, done.output
    assert len(stored(store)[1]) == count
    assert ("--include-tests" in " ".join(done.stdout.split())) == (count == 2)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("hello\n", "header of no known table"),
        (DRIVES + "t2,1700009000.0,x,11.5,,850:7,-90,1\n", "not a number (line 122)"),
        (
            DRIVES.replace("lat,lon", "lon,lat").replace(",11.5,", ",111.5,"),
            "lon and lat look swapped",
        ),
    ],
)
def test_a_wrong_or_broken_file_stores_nothing_and_the_next_is_taken(
    run, store, tmp_path, text, complaint
):
    """Also what came before the fault; the reason names the line."""
    bad, good = tmp_path / "bad.csv", tidy_csv(tmp_path / "good.csv")
    bad.write_text(text)
    done = run("import", bad, good, "--data", store, "--no-build")
    assert done.exit_code == 1
    assert complaint in " ".join(done.stderr.split())
    assert len(stored(store)[1]) == 1


def test_a_drive_with_exchanged_coordinates_is_refused_with_its_line(run, store, tmp_path):
    """The other drives of the file come in."""
    path = tmp_path / "drives.csv"
    rows = "".join(f"t9,170001{i:04d}.0,11.5,48.{i:04d},,850:7,-90,1\n" for i in range(9))
    path.write_text(DRIVES + rows)
    done = run("import", path, "--data", store, "--no-build")
    assert done.exit_code == 1
    told = " ".join(done.stdout.replace("│", "").split())
    assert "refused: swapped-places" in told
    assert "(from line 122)" in told
    assert len(stored(store)[1]) == 3


def test_keep_going_takes_the_sound_rows_of_a_broken_file(run, store, tmp_path):
    """And says which were not."""
    path = tmp_path / "bad.csv"
    path.write_text(DRIVES + "t2,1700009000.0,x,11.5,,850:7,-90,1\n")
    done = run("import", path, "--data", store, "--no-build", "--keep-going")
    assert done.exit_code == 0, done.output
    assert "rows dropped: not a number" in done.stdout
    assert "(line 122)" in done.stdout
    assert len(stored(store)[1]) == 3


def test_device_and_time_zone_are_what_the_person_says(run, store, tmp_path):
    """Local times are moved to UTC, and the account says by which zone."""
    path = tmp_path / "log.txt"
    head = "Timestamp\tLongitude\tLatitude\tNetworkTech\tLevel\tARFCN\tPSC\n"
    rows = "".join(
        f"2025.01.08_10.00.{i:02d}\t11.5\t48.{i:04d}\t4G\t-90\t850\t7\t\n" for i in range(9)
    )
    path.write_text(head + rows)
    words = ["--device", "blue phone", "--time-zone", "Europe/Berlin", "--format", "gnettrack"]
    done = run("import", path, "--data", store, "--no-build", *words)
    assert done.exit_code == 0, done.output
    (survey,) = stored(store)[1]
    assert survey.device == "blue phone"
    assert survey.recorded_at.hour == 9
    assert "Europe/Berlin" in done.stdout


@pytest.mark.parametrize("words", [["--time-zone", "Mars"], ["--format", "nemo"]])
def test_an_option_without_meaning_is_refused_before_anything_happens(run, store, tmp_path, words):
    """Exit code 2, no store."""
    done = run("import", tidy_csv(tmp_path / "drive.csv"), "--data", store, *words)
    assert done.exit_code == 2
    assert words[1] in done.stderr
    assert not store.exists()
