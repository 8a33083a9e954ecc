"""States: what a client keeps of a track comes back whole, or is refused with the reason."""

from __future__ import annotations

import base64
import hashlib
import hmac
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.domain import Calibration, Line, RadioMap, Window
from app.errors import InvalidInput
from app.numerics.belief import Belief, Mode
from app.numerics.index import MapIndex
from app.numerics.matching import locate as located
from app.numerics.tracking import Tracked, begin, follow
from app.services.states import (
    FORMAT,
    MAX_STATE_CHARACTERS,
    PURPOSE,
    TAG_BYTES,
    KeptMode,
    KeptTrack,
    Mark,
    seal,
    unseal,
)
from app.services.track import Way, _kept, locate_tracked, travelled_m
from tests.factories import line_at, model_of

KEY, OTHER = b"k" * 32, b"o" * 32
SHARES = st.floats(0.0, 1.0, width=32)
MODES = st.builds(
    KeptMode,
    st.text(st.characters(codec="utf-8", categories=("L", "N", "P")), min_size=1, max_size=128),
    st.sampled_from([1, -1]),
    st.floats(0.0, 1e5, width=32),
    st.floats(0.125, 1e3, width=32),
    SHARES,
    st.floats(-180.0, 180.0),
    st.floats(-85.0, 85.0),
    st.floats(0.0, 360.0),
)
MARKS = st.builds(
    Mark,
    st.sampled_from(["m", "s"]),
    st.floats(-1e12, 1e12),
    st.floats(-1e12, 1e12),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**32 - 1),
)
TRACKS = st.builds(
    KeptTrack,
    st.integers(0, 2**32 - 1),
    SHARES,
    SHARES,
    MARKS,
    st.lists(MODES, max_size=64).map(tuple),
)


@given(TRACKS)
def test_a_track_comes_back_whole(track: KeptTrack):
    """All numbers as they were, coordinates within a centimetre, headings within a degree."""
    state = seal(track, KEY)
    assert re.fullmatch(r"[A-Za-z0-9_-]+", state)
    back = unseal(state, KEY)
    assert (back.map_version, back.anywhere, back.off_map) == (
        track.map_version,
        track.anywhere,
        track.off_map,
    )
    assert back.mark == track.mark
    for one, other in zip(track.modes, back.modes, strict=True):
        assert (one.road_id, one.sign, one.chainage_m) == (
            other.road_id,
            other.sign,
            other.chainage_m,
        )
        assert (one.sd_m, one.weight) == (other.sd_m, other.weight)
        assert (other.lon, other.lat) == pytest.approx((one.lon, one.lat), abs=1e-7)
        assert abs((one.heading_deg - other.heading_deg + 180.0) % 360.0 - 180.0) < 1.0


def track_of(modes: int = 3) -> KeptTrack:
    each = [KeptMode("road", 1, 10.0 * i, 2.0, 0.25, -118.0, 34.0, 90.0) for i in range(modes)]
    return KeptTrack(7, 0.15, 0.1, Mark("m", 0.0, 100.0, 1, 2), tuple(each))


def refusal(state: str, key: bytes = KEY) -> str:
    with pytest.raises(InvalidInput) as caught:
        unseal(state, key)
    (fault,) = caught.value.faults
    assert fault.pointer == "/state"
    return fault.detail


def test_every_changed_bit_is_noticed():
    """Whichever byte of a state is changed, it is refused."""
    state = seal(track_of(), KEY)
    raw = bytearray(base64.urlsafe_b64decode(state + "=" * (-len(state) % 4)))
    for place in range(len(raw)):
        raw[place] ^= 1
        assert "did not make" in refusal(base64.urlsafe_b64encode(raw).decode().rstrip("="))
        raw[place] ^= 1


@pytest.mark.parametrize("cut", [1, 5, 20, 60])
def test_a_shortened_state_is_refused(cut: int):
    """At either end."""
    state = seal(track_of(), KEY)
    assert refusal(state[:-cut])
    assert refusal(state[cut:])


@pytest.mark.parametrize(
    "rubbish", ["x", "????", "ä" * 40, "AAAA", " ", "null", "=" * 8, "A" * 200]
)
def test_rubbish_is_refused(rubbish: str):
    """Whatever text it is."""
    assert refusal(rubbish)


def test_a_foreign_state_is_refused():
    """Another key's state is none."""
    assert "did not make" in refusal(seal(track_of(), KEY), OTHER)


def test_an_endless_state_is_refused_before_it_is_read():
    """By its length alone."""
    assert str(MAX_STATE_CHARACTERS) in refusal("A" * (MAX_STATE_CHARACTERS + 1))


def test_the_largest_state_is_accepted():
    """64 modes on 64 roads with ids as long as they may be."""
    ids = [f"{number:02d}" + "\U0001f6e3" * 126 for number in range(64)]
    modes = tuple(KeptMode(each, 1, 0.0, 1.0, 0.0625, 0.0, 0.0, 0.0) for each in ids)
    state = seal(KeptTrack(1, 0.0, 0.0, Mark("m", 0.0, 0.0, 0, 0), modes), KEY)
    assert len(state) <= MAX_STATE_CHARACTERS
    assert unseal(state, KEY).modes == modes


@given(st.integers(0, 10_000), st.integers(1, 60), st.integers(0, 30))
def test_the_readings_of_a_young_track_come_back(seed: int, samples: int, cells: int):
    """To a hundredth of a decibel, what was not heard not heard, the last sample at 0."""
    rng = np.random.default_rng(seed)
    rsrp_dbm = rng.uniform(-140.0, -44.0, (samples, cells))
    rsrp_dbm[rng.random(rsrp_dbm.shape) < 0.6] = np.nan
    names = tuple(f"{number}:\u00e4{number}" for number in range(cells))
    heard = Window(names, np.cumsum(rng.uniform(0.0, 9.0, samples)), rsrp_dbm)
    back = unseal(seal(replace(track_of(), heard=heard), KEY), KEY)
    assert back.modes == track_of().modes
    assert back.heard is not None
    assert back.heard.cells == names
    wanted_m = heard.distance_m - heard.distance_m[-1]
    np.testing.assert_allclose(back.heard.distance_m, wanted_m, atol=1e-4)
    np.testing.assert_allclose(back.heard.rsrp_dbm, rsrp_dbm, atol=0.0051)


def test_more_readings_than_a_state_may_carry_are_left_behind():
    """The track goes on by its belief alone, and the state stays below its most characters."""
    rng = np.random.default_rng(1)
    rsrp_dbm = rng.uniform(-140.0, -44.0, (400, 60))
    heard = Window(tuple(map(str, range(60))), np.arange(400.0), rsrp_dbm)
    state = seal(replace(track_of(64), heard=heard), KEY)
    assert len(state) < MAX_STATE_CHARACTERS
    assert unseal(state, KEY).heard is None


def test_a_state_carries_what_the_next_window_needs():
    """Over two requests the answers are those of the tracker that has its belief in memory."""
    index = index_of(("south", line_at(0.0)), ("north", line_at(40.0)))
    first, second = window_at(TEN, 3), window_at(TEN, 4)
    told = locate_tracked(index, first, way_of(TEN.tolist()), None, KEY, 0.68)
    then = locate_tracked(
        index, second, way_of((TEN + 110.0).tolist(), travelled_m=110.0), told.state, KEY, 0.68
    )
    begun = begin(index, first)
    wanted = follow(index, second, begun.belief, 110.0, heard=begun.heard)
    assert wanted.heard is not None
    assert (then.fix.road_id, then.fix.direction) == (wanted.fix.road_id, wanted.fix.direction)
    assert then.fix.chainage_m == pytest.approx(wanted.fix.chainage_m, abs=0.05)
    assert then.fix.samples_used == wanted.fix.samples_used


def test_a_state_of_an_older_format_says_so():
    """Rightly signed, but laid out by an earlier version of the service."""
    payload = bytes([FORMAT - 1]) + b"\0" * 50
    tag = hmac.new(KEY, PURPOSE + payload, hashlib.sha256).digest()[:TAG_BYTES]
    assert "older format" in refusal(base64.urlsafe_b64encode(payload + tag).decode().rstrip("="))


def window_at(distance_m: np.ndarray, seed: int = 0) -> Window:
    rng = np.random.default_rng(seed)
    return Window(("850:293", "850:60"), distance_m, rng.uniform(-110, -70, (len(distance_m), 2)))


def way_of(values: list[float], **told: float) -> Way:
    return Way("m", np.array(values), **told)


TEN = np.arange(11) * 10.0


def test_the_way_since_the_last_window():
    """As told; by one odometer; by one clock; back to back, a sample shared or a step between."""
    window = window_at(TEN)
    before = Mark("m", 0.0, 100.0, 11, 12)
    mark = Mark("m", 40.0, 140.0, 13, 14)
    assert travelled_m(before, mark, window, way_of([40.0, 140.0], travelled_m=7.5)) == 7.5
    assert travelled_m(before, mark, window, way_of([40.0, 140.0])) == 40.0
    later = Mark("m", 500.0, 600.0, 13, 14)
    assert travelled_m(before, later, window, way_of([500.0, 600.0])) == 500.0
    anew = Mark("m", 0.0, 100.0, 13, 14)
    assert travelled_m(before, anew, window, way_of([0.0, 100.0])) == pytest.approx(110.0)
    shared = Mark("m", 0.0, 100.0, 12, 14)
    assert travelled_m(before, shared, window, way_of([0.0, 100.0])) == 100.0
    growing = Mark("m", 0.0, 130.0, 11, 15)
    assert travelled_m(before, growing, window, way_of([0.0, 130.0])) == 30.0


def test_the_way_by_a_clock():
    """Readings after the last window's end count by their distance, silence by the speed."""
    window, times = window_at(TEN), np.arange(11.0)
    before = Mark("s", 0.0, 10.0, 1, 2)
    overlapping = Way("s", times + 4.0, 10.0)
    assert travelled_m(before, Mark("s", 4.0, 14.0, 3, 4), window, overlapping) == pytest.approx(
        40.0
    )
    later = Way("s", times + 15.0, 10.0)
    assert travelled_m(before, Mark("s", 15.0, 25.0, 3, 4), window, later) == pytest.approx(150.0)


def index_of(*roads: tuple[str, Line], version: int = 1) -> MapIndex:
    models = [model_of(road_id, seed=i, line=line) for i, (road_id, line) in enumerate(roads)]
    return MapIndex.build(RadioMap(version, tuple(models), Calibration()))


def locate(index: MapIndex, state: str | None, *, key: bytes = KEY, start_m: float = 0.0):
    way_m = np.arange(11) * 2.0
    window = Window(("850:293", "850:60"), way_m, np.full((11, 2), np.nan))
    return locate_tracked(index, window, way_of((way_m + start_m).tolist()), state, key, 0.68)


def begun_at(index: MapIndex, road_id: str, chainage_m: float, sign: int = 1) -> str:
    """A state that is sure of a place, as the index's version would give it out."""
    mode = Mode(index.road_ids.index(road_id), sign, chainage_m, 2.0, 0.95)
    mark = Mark("m", -20.0, 0.0, 0, 0)
    tracked = Tracked(located(index, window_at(TEN)), Belief((mode,), 0.03, 0.02))
    return seal(_kept(index, tracked, mark), KEY)


def test_a_state_outlives_a_new_map_version():
    """Roads are known again by id, though their numbers and their lines' ends changed."""
    north, south = line_at(40.0), line_at(0.0)
    longer = line_at(40.0, length_m=230.0, x_m=-30.0)
    old = index_of(("south", south), ("north", north))
    new = index_of(("east", line_at(500.0)), ("north", longer), version=2)
    fix = locate(new, begun_at(old, "north", 100.0)).fix
    assert (fix.map_version, fix.road_id) == (2, "north")
    assert fix.chainage_m == pytest.approx(150.0, abs=3.0)  # 100 + 20 driven + 30 drawn longer


def test_a_road_drawn_the_other_way_round_is_driven_the_other_way():
    """The vehicle goes on eastward, which is now against the line."""
    there = line_at(0.0)
    back = Line(there.lon[::-1].copy(), there.lat[::-1].copy())
    old, new = index_of(("road", there)), index_of(("road", back), version=2)
    fix = locate(new, begun_at(old, "road", 100.0)).fix
    assert fix.direction.sign == -1
    assert fix.chainage_m == pytest.approx(80.0, abs=3.0)


def test_a_state_of_roads_that_are_gone_is_refused():
    """With the version and the roads named."""
    state = begun_at(index_of(("gone", line_at())), "gone", 50.0)
    with pytest.raises(InvalidInput) as caught:
        locate(index_of(("other", line_at()), version=2), state)
    assert caught.value.faults[0].pointer == "/state"
    assert "'gone'" in caught.value.faults[0].detail
    assert "map version 2" in caught.value.faults[0].detail


def test_an_old_state_may_be_replayed():
    """Nothing is kept: the same state and window have the same answer, again and again."""
    index = index_of(("a", line_at()), ("b", line_at(60.0)))
    first = locate(index, None)
    once, twice = (locate(index, first.state, start_m=20.0) for _ in range(2))
    assert once == twice
