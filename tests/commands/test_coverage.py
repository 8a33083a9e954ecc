"""`roadprint coverage`: over HTTP and straight on a folder, in words and as GeoJSON."""

from __future__ import annotations

import functools
import json

import pytest

from app.commands import local
from app.commands.local import LocalTarget
from app.commands.target import Posted
from app.domain import Road
from app.numerics.roadfit import fit_road
from app.services import roadwork
from app.services.builds import request_build
from app.services.coverage import survey_coverage
from app.settings import Settings
from app.store.engine import create_store_engine
from tests.api.conftest import serving
from tests.factories import line_at, trace_along
from tests.services.building import calibrate


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A data folder with a road driven once, built, and a road that is only drawn."""
    folder = tmp_path_factory.mktemp("surveyed")
    settings = Settings(data_dir=folder)
    with LocalTarget(settings) as target:
        target.put_road(Road("once", "Main [Street]", line_at(length_m=400.0)))
        target.put_road(Road("wanted", None, line_at(300.0)))
        trace = trace_along(line_at(length_m=400.0), seed=3, road_id="once")
        assert isinstance(target.post_trace(trace, None), Posted)
    engine = create_store_engine(settings.store_url)
    build_id = request_build(engine, ["once"]).id
    roadwork.begin_build(engine, build_id)
    assert roadwork.build_road(engine, fit_road, build_id, "once")
    roadwork.publish(engine, calibrate, build_id)
    engine.dispose()
    return folder


def test_the_table_says_where_to_drive_and_why(run, folder):
    """Lengths, shares, the expected error, and the undriven road first."""
    done = run("coverage", "--data", folder)
    assert done.exit_code == 0, done.stderr
    assert "map version 1: 0.6 km of road" in done.stdout
    assert "never driven 0.2 km, driven once 0.4 km" in done.stdout
    assert "0% in both directions, 0% on two days or more" in done.stdout
    assert "expected error of 200 m windows" in done.stdout
    assert done.stdout.index("wanted") < done.stdout.index("once", done.stdout.index("helps"))
    assert "never driven" in done.stdout.split("helps most")[1]


def test_the_file_holds_every_stretch(run, folder, tmp_path):
    """GeoJSON with one feature a stretch, all pages joined."""
    file = tmp_path / "coverage.geojson"
    done = run("coverage", "--data", folder, "--out", file)
    assert done.exit_code == 0, done.stderr
    document = json.loads(file.read_text())
    assert document["type"] == "FeatureCollection"
    assert document["next_cursor"] is None
    assert {one["properties"]["road_id"] for one in document["features"]} == {"once", "wanted"}
    assert all(one["geometry"]["type"] == "LineString" for one in document["features"])


def test_a_service_says_the_same(run, folder, tmp_path):
    """`--url` and the folder itself give one answer."""
    with serving(folder) as service:
        file = tmp_path / "served.geojson"
        url = str(service.client.base_url)
        served = run("coverage", "--url", url, "--out", file)
        local = run("coverage", "--data", folder, "--out", tmp_path / "local.geojson")
    assert served.exit_code == local.exit_code == 0, served.stderr
    assert served.stdout.split("stretches")[0] == local.stdout.split("stretches")[0]
    assert json.loads(file.read_text()) == json.loads((tmp_path / "local.geojson").read_text())


def test_pages_are_joined(run, folder, tmp_path, monkeypatch):
    """A city has more stretches than a page: pages of one make the same file as one page of all."""
    files = tmp_path / "whole.geojson", tmp_path / "joined.geojson"
    assert run("coverage", "--data", folder, "--out", files[0]).exit_code == 0
    monkeypatch.setattr(local, "survey_coverage", functools.partial(survey_coverage, limit=1))
    assert run("coverage", "--data", folder, "--out", files[1]).exit_code == 0
    whole, joined = (json.loads(file.read_text()) for file in files)
    assert len(whole["features"]) > 2
    assert joined == whole


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (["--bbox", "0,0,1,1"], 1, "no road touches this box"),
        (["--bbox", "0,0,1"], 1, "is not west,south,east,north"),
        (["--version", "99"], 1, "no map version 99"),
        (["--version", "0"], 2, "greater than or equal to 1"),
        (["--out", "/no/such/folder/c.geojson"], 2, "its folder does not exist"),
        (["--url", "http://127.0.0.1:9"], 2, "--url or --data, not both"),
    ],
)
def test_what_is_asked_wrongly_is_said(run, folder, words, code, sentence):
    """A sentence on standard error and an exit code, never a trace of the stack."""
    done = run("coverage", "--data", folder, *words)
    assert done.exit_code == code
    assert sentence in " ".join(done.stderr.split())


def test_an_empty_folder_has_no_road(run, tmp_path):
    """There is nothing to say, and what to do instead."""
    done = run("coverage", "--data", tmp_path)
    assert done.exit_code == 1
    assert "import drives or a network first" in done.stderr
