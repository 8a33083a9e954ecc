"""Local metres against the geodesics of the WGS 84 ellipsoid (pyproj, which is PROJ)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod

from app.numerics.geodesy import LocalFrame, distance_m, metres_per_degree, wrap_longitude_deg

GEOD = Geod(ellps="WGS84")

longitudes = st.floats(-180.0, 180.0)
latitudes = st.floats(-70.0, 70.0)
azimuths = st.floats(0.0, 360.0)


@settings(derandomize=True, deadline=None, max_examples=300)
@given(lon=longitudes, lat=latitudes, azimuth=azimuths, away_m=st.floats(0.01, 20_000.0))
def test_distance_is_the_geodesics(lon, lat, azimuth, away_m):
    """Below 70 degrees and 20 km, distances are within 0.01 % of the geodesic, everywhere."""
    lon2, lat2, _ = GEOD.fwd(lon, lat, azimuth, away_m)
    if abs(lat2) > 70.0:
        lat2 = np.sign(lat2) * 70.0
        _, _, away_m = GEOD.inv(lon, lat, lon2, lat2)
    assert distance_m(lon, lat, lon2, lat2) == pytest.approx(away_m, rel=1e-4, abs=1e-6)


@settings(derandomize=True, deadline=None, max_examples=200)
@given(lon=longitudes, lat=latitudes, x_m=st.floats(-5000, 5000), y_m=st.floats(-5000, 5000))
def test_frame_and_back_is_where_one_was(lon, lat, x_m, y_m):
    """Metres to degrees and back are the same metres, on the antimeridian, too."""
    frame = LocalFrame(lon, lat)
    place = frame.to_lonlat(x_m, y_m)
    assert -180.0 <= place.lon < 180.0
    back = frame.to_xy(place.lon, place.lat)
    assert back.x_m == pytest.approx(x_m, abs=1e-5)
    assert back.y_m == pytest.approx(y_m, abs=1e-5)


@pytest.mark.parametrize("lat", [-54.8, -33.9, 0.0, 34.0, 48.1, 65.0])
def test_frame_points_east_and_north(lat):
    """A kilometre along either axis ends within half a metre of the geodesic's end."""
    frame = LocalFrame(151.2, lat)
    for azimuth, x_m, y_m in ((90.0, 1000.0, 0.0), (180.0, 0.0, -1000.0), (45.0, 707.107, 707.107)):
        lon2, lat2, _ = GEOD.fwd(151.2, lat, azimuth, 1000.0)
        place = frame.to_lonlat(x_m, y_m)
        _, _, miss_m = GEOD.inv(lon2, lat2, float(place.lon), float(place.lat))
        assert miss_m < 0.5


def test_hemispheres_mirror():
    """A degree is as long south of the equator as north of it, and shorter poleward."""
    north, south = metres_per_degree([10.0, 45.0, 60.0]), metres_per_degree([-10.0, -45.0, -60.0])
    np.testing.assert_array_equal(north.x_m, south.x_m)
    np.testing.assert_array_equal(north.y_m, south.y_m)
    assert np.all(np.diff(north.x_m) < 0)
    assert np.all(np.diff(north.y_m) > 0)


def test_across_the_antimeridian_is_a_step():
    """From 179.999 to -179.999 degrees is 0.002 degrees, in distances and in frames."""
    _, _, away_m = GEOD.inv(179.999, -17.0, -179.999, -17.0)
    assert distance_m(179.999, -17.0, -179.999, -17.0) == pytest.approx(away_m, rel=1e-6)
    frame = LocalFrame(179.999, -17.0)
    assert frame.to_xy(-179.999, -17.0).x_m == pytest.approx(away_m, rel=1e-6)
    assert frame.to_lonlat(away_m, 0.0).lon == pytest.approx(-179.999, abs=1e-9)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(lon=st.floats(-180.0, 179.999), turns=st.integers(-3, 3))
def test_whole_turns_change_no_meridian(lon, turns):
    """Longitudes are wrapped to [-180, 180) and a turn more is the same place."""
    wrapped = wrap_longitude_deg(lon + 360.0 * turns)
    assert -180.0 <= wrapped < 180.0
    assert abs((wrapped - lon + 180.0) % 360.0 - 180.0) < 1e-9


def test_distances_are_elementwise():
    """Arrays give what their elements give one by one."""
    rng = np.random.default_rng(3)
    lon, lat = rng.uniform(-118.5, -118.4, (2, 9)), rng.uniform(34.0, 34.1, (2, 9))
    together = distance_m(lon[0], lat[0], lon[1], lat[1])
    pairs = zip(lon[0], lat[0], lon[1], lat[1], strict=True)
    one_by_one = [float(distance_m(*each)) for each in pairs]
    np.testing.assert_array_equal(together, one_by_one)
