"""Longitude and latitude exchanged: named wherever other drives are known, and nothing else is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Line, Road
from app.numerics.geodesy import LocalFrame
from app.services import ingest, roads, surveys
from app.services.swapped import SwappedPlaces, refuse_swapped_drives
from tests.factories import trace_along
from tests.formats.cities import CITIES

# As a latitude a longitude beyond 90 degrees is none: such a file ends where it is read.
ON_EITHER = {name: place for name, place in CITIES.items() if abs(place[0]) < 90.0}
MIRRORED_WITHIN_150_KM = {"Cairo"}


def drive_in(city, seed, **changed):
    """A drive through one of a city's streets, up to 5 km from its middle."""
    rng = np.random.default_rng(seed)
    frame = LocalFrame(*CITIES[city][:2])
    at = frame.to_lonlat(*np.cumsum(rng.uniform(-900.0, 900.0, (4, 2)), axis=0).T)
    x, y = rng.uniform(-3000.0, 3000.0, 2)
    moved = frame.to_lonlat(*(np.stack([frame.to_xy(at.lon, at.lat).x_m + x,
                                        frame.to_xy(at.lon, at.lat).y_m + y])))  # fmt: skip
    line = Line(np.asarray(moved.lon), np.asarray(moved.lat))
    return replace(trace_along(line, seed=seed, step_m=25.0), **changed)


def swapped(trace):
    return replace(trace, lon=trace.lat, lat=trace.lon)


@pytest.mark.parametrize("city", ON_EITHER)
def test_an_exchanged_drive_of_a_known_city_is_named(engine, city):
    """Refused with its first place; nothing of it is stored; the city's other drives come in."""
    ingest.accept_survey(engine, drive_in(city, 1))
    if city in MIRRORED_WITHIN_150_KM:
        ingest.accept_survey(engine, swapped(drive_in(city, 2)))  # nobody can tell
        return
    wrong = swapped(drive_in(city, 2))
    with pytest.raises(SwappedPlaces, match=f"swapped: lon {wrong.lon[0]:g}") as refused:
        ingest.accept_survey(engine, wrong)
    assert refused.value.faults[0].pointer == "/lon/0"
    ingest.accept_survey(engine, drive_in(city, 2))
    assert len(surveys.list_surveys(engine).items) == 2


def test_correct_drives_of_all_cities_come_in_in_any_order(engine):
    """A city far from all that is known is new, not wrong."""
    names = list(CITIES)
    np.random.default_rng(5).shuffle(names)
    for seed, city in enumerate(names):
        ingest.accept_survey(engine, drive_in(city, seed))


def test_a_drawn_network_knows_its_place(engine):
    """Roads alone, before any drive, are enough to tell."""
    lon, lat, _ = CITIES["Munich"]
    line = Line(np.array([lon, lon + 0.01]), np.array([lat, lat]))
    roads.put_road(engine, Road("main", None, line))
    with pytest.raises(SwappedPlaces, match="road main"):
        ingest.accept_survey(engine, swapped(drive_in("Munich", 3)))


def test_cells_of_the_right_country_settle_it(engine):
    """Of two towns that mirror each other the second comes in when its cells are its country's."""
    wrong = swapped(drive_in("Warsaw", 1))  # what it says is a town in Arabia
    ingest.accept_survey(engine, wrong)
    right = drive_in("Warsaw", 2)
    with pytest.raises(SwappedPlaces):
        ingest.accept_survey(engine, right)
    ingest.accept_survey(engine, replace(right, global_ids={right.cells[0]: "260-01-5387"}))


def test_drives_of_one_file_are_held_against_each_other(engine):
    """The second city's drives of a file that exchanges half of its rows are named by number."""
    some = [drive_in("Kyiv", 1), drive_in("Kyiv", 2), swapped(drive_in("Kyiv", 3))]
    refuse_swapped_drives(engine, some[:2])
    with pytest.raises(SwappedPlaces, match="earlier drive") as refused:
        refuse_swapped_drives(engine, some)
    assert refused.value.drive == 2
