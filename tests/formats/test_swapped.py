"""Longitude and latitude in each other's place are called by their name, right ones never."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.formats import account as reasons
from app.formats.account import WrongFile

from . import samples
from .cities import CITIES, OWN_MIRROR
from .conftest import read_text

LAWS = settings(max_examples=60, deadline=None, derandomize=True)  # the seed is the test's name


@LAWS
@given(st.floats(91.0, 170.0), st.floats(-80.0, 80.0))
def test_swapped_columns_are_named(lon, lat):
    """A latitude beyond 90 degrees that would be a longitude is called by its name."""
    rows = "".join(f"{i},{lat + 1e-4 * i:.6f},{lon:.6f},850:1,-90\n" for i in range(4))
    with pytest.raises(WrongFile, match=reasons.SWAPPED):
        read_text("time_s,lon,lat,cell_id,rsrp_dbm\n" + rows)


@pytest.mark.parametrize(
    ("lon", "lat", "mcc", "found"),
    [
        (48.1, 11.6, "262", True),  # Munich
        (28.6, 77.2, "404", True),  # Delhi
        (-23.5, -46.6, "724", True),  # Sao Paulo
        (11.6, 48.1, "262", False),
        (-46.6, -23.5, "724", False),
        (3.4, 6.5, "621", False),  # Lagos, exchanged: both places are in Nigeria, nobody can tell
        (48.1, 11.6, "001", False),  # a test network is in no country
    ],
)
def test_positions_in_another_part_of_the_world_than_their_cells_are_named(lon, lat, mcc, found):
    """Both numbers would be right, and the country code says that they are swapped."""
    text = samples.OPENCELLID_NAMES + "\n" + "".join(
        samples.opencellid_row(i, lon=lon, lat=lat + 1e-4 * i, mcc=mcc) for i in range(3)
    )  # fmt: skip
    if found:
        with pytest.raises(WrongFile, match=f"swapped.*{mcc}"):
            read_text(text)
    else:
        assert read_text(text).account.samples == 3


@LAWS
@given(st.sampled_from(sorted(CITIES)), st.floats(-0.05, 0.05), st.floats(-0.05, 0.05))
def test_exchanged_positions_of_any_city_are_named_by_country_or_range(city, east, north):
    """Right ones never are; wrong ones are named with their line, wherever on the earth."""
    lon, lat, mcc = CITIES[city]
    lon = (lon + east + 180.0) % 360.0 - 180.0
    places = [(round(lon, 6), round(lat + north + 1e-4 * i, 6)) for i in range(3)]
    for swapped in (False, True):
        text = samples.OPENCELLID_NAMES + "\n" + "".join(
            samples.opencellid_row(i, lon=x, lat=y, mcc=mcc)
            for i, (x, y) in enumerate((y, x) if swapped else (x, y) for x, y in places)
        )  # fmt: skip
        if swapped and city not in OWN_MIRROR:
            with pytest.raises(WrongFile, match=r"swapped.*line 2"):
                read_text(text)
        else:
            assert read_text(text).account.samples == 3
