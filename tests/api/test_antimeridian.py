"""Taveuni, where the antimeridian crosses the streets: from drives to fixes and maps, over HTTP."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from app.numerics.calibration import calibrate
from app.numerics.geodesy import LocalFrame, distance_m
from app.numerics.network.finding import find_roads
from app.numerics.roadfit import fit_road
from app.services import network, roadwork
from tests.api.conftest import Service, serving

HERE = LocalFrame(179.9995, -16.85)
MASTS_M = np.array([[-300.0, 40.0], [350.0, -60.0], [120.0, 380.0], [-80.0, -350.0]])
CELLS = [f"850:{number}" for number in range(4)]
EAST = ((-420.0, 0.0), (420.0, 0.0))
NORTH = ((120.0, -400.0), (120.0, 420.0))
TURN = ((-420.0, 0.0), (120.0, 0.0), (120.0, 420.0))


def heard(seed: int, corners: Any, *, backward: bool = False) -> dict[str, Any]:
    """Places and levels of a drive at 8 m/s through corners, local metres."""
    rng = np.random.default_rng(seed)
    at = np.array(corners[::-1] if backward else corners, dtype=float)
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(at, axis=0).T))])
    along_m = np.arange(0.0, way_m[-1], 8.0)
    x, y = (np.interp(along_m, way_m, axis) for axis in at.T)
    away = np.hypot(x[:, None] - MASTS_M[:, 0], y[:, None] - MASTS_M[:, 1])
    hills = 5.0 * np.sin((x + y)[:, None] / 37.0 + np.arange(4)) + 4.0 * np.cos(x / 23.0)[:, None]
    level_dbm = -60.0 - 32.0 * np.log10(away / 30.0 + 1.0) + hills
    level_dbm += rng.normal(0.0, 1.5, level_dbm.shape)
    places = HERE.to_lonlat(x + rng.normal(0, 1.5, x.shape), y + rng.normal(0, 1.5, y.shape))
    return {
        "lon": np.asarray(places.lon),
        "lat": np.asarray(places.lat),
        "distance_m": along_m,
        "rsrp_dbm": np.round(np.clip(level_dbm, -130.0, -50.0)),
    }


@pytest.fixture(scope="module")
def taveuni(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A service with the map that a worker makes of five drives across the antimeridian."""
    drives = [(EAST, False), (EAST, True), (NORTH, False), (NORTH, True), (TURN, False)]
    with serving(tmp_path_factory.mktemp("taveuni")) as running:
        for seed, (corners, backward) in enumerate(drives):
            told = heard(seed, corners, backward=backward)
            posted = running.client.post("/v1/surveys", json={
                "cells": CELLS, "device": "pixel4a",
                "recorded_at": f"2024-03-0{seed + 1}T09:00:00Z",
                "time_s": (told["distance_m"] / 8.0).tolist(),
                "lon": told["lon"].tolist(), "lat": told["lat"].tolist(),
                "rsrp_dbm": told["rsrp_dbm"].tolist(),
            })  # fmt: skip
            assert posted.status_code == 202, posted.text
        build_id = posted.json()["build_id"]
        roadwork.begin_build(running.engine, build_id)
        count = network.place_drives(running.engine, find_roads, build_id)
        for road_id in roadwork.waiting_roads(running.engine, build_id, 0, count):
            roadwork.build_road(running.engine, fit_road, build_id, road_id)
        roadwork.publish(running.engine, calibrate, build_id)
        build = running.client.get(f"/v1/builds/{build_id}").json()
        assert (build["status"], build["roads_done"]) == ("successful", 2), build
        running.wait_for_map(build["map_version"])
        yield running


def crossing(service: Service) -> str:
    """The id of the street that the antimeridian crosses."""
    (one,) = (road["id"] for road in roads(service) if np.ptp([*longitudes(road["line"])]) > 180)
    return str(one)


def roads(service: Service, **query: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = service.client.get("/v1/roads", params=query).json()["roads"]
    return found


def longitudes(geometry: dict[str, Any]) -> Iterator[float]:
    many = geometry["coordinates"]
    for part in many if geometry["type"] == "MultiLineString" else [many]:
        yield from (place[0] for place in part)


def test_two_streets_of_their_true_lengths_are_found(taveuni: Service):
    """One crosses the antimeridian and stays whole; all passes lie on the two."""
    lengths_m = sorted(road["length_m"] for road in roads(taveuni))
    assert lengths_m == pytest.approx([820.0, 840.0], abs=25.0)
    assert sorted(road["pass_count"] for road in roads(taveuni)) == [3, 3]


def test_windows_across_the_antimeridian_are_located(taveuni: Service):
    """Fixes and all candidates lie on the island, near the truth, in [-180, 180)."""
    errors_m = []
    for seed, corners in enumerate((EAST, NORTH) * 6):
        told = heard(100 + seed, corners, backward=seed % 3 == 0)
        end = 42 + 5 * seed
        part = slice(end - 25, end)
        fix = taveuni.client.post("/v1/locate", json={
            "cells": CELLS,
            "distance_m": told["distance_m"][part].tolist(),
            "rsrp_dbm": told["rsrp_dbm"][part].tolist(),
        }).json()  # fmt: skip
        assert fix["status"] == "located"
        assert fix["accuracy_m"] < 100.0
        for one in (fix["position"], *fix["candidates"]):
            assert 179.99 < abs(one["lon"]) <= 180.0 > one["lon"]
        place, truth = fix["position"], (told["lon"][end - 1], told["lat"][end - 1])
        errors_m.append(float(distance_m(place["lon"], place["lat"], *truth)))
    assert np.median(errors_m) < 15.0, errors_m
    assert max(errors_m) < 60.0, errors_m


@pytest.mark.parametrize("path", ["/v1/roads", "/v1/coverage", "/v1/roads/{}/segments"])
def test_geojson_is_cut_at_the_antimeridian(taveuni: Service, path: str):
    """No part of a geometry runs round the earth (RFC 7946, 3.1.9), and none is lost."""
    answer = taveuni.client.get(
        path.format(crossing(taveuni)), headers={"Accept": "application/geo+json"}
    )
    drawn = [one["geometry"] for one in answer.json()["features"]]
    kinds = {geometry["type"] for geometry in drawn}
    assert "MultiLineString" in kinds
    for geometry in drawn:
        many = geometry["coordinates"]
        for part in many if geometry["type"] == "MultiLineString" else [many]:
            assert len(part) > 1
            assert np.ptp([place[0] for place in part]) < 1.0
        assert all(179.99 < abs(lon) <= 180.0 for lon in longitudes(geometry))


@pytest.mark.parametrize(
    ("bbox", "streets"),
    [
        ("179.99,-17,-179.99,-16", 2),
        ("179.9,-17,179.9993,-16", 1),
        ("-180,-17,-179.999,-16", 2),
        ("179.9,-17,180,-16", 1),
        ("-180,-90,180,90", 2),
        ("-10,-17,10,-16", 0),
    ],
)
def test_boxes_find_what_they_touch(taveuni: Service, bbox: str, streets: int):
    """Roads and stretches of coverage, whichever side of the antimeridian the box is on."""
    assert len(roads(taveuni, bbox=bbox)) == streets
    found = taveuni.client.get("/v1/coverage", params={"bbox": bbox}).json()["features"]
    assert len({one["properties"]["road_id"] for one in found}) == streets
