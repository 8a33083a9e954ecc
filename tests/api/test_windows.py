"""The quick look at a window and the spelled-out one refuse the same."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.api.schemas.locate import LocateRequest
from app.api.state import Limits
from app.api.windows import _clean_window, faults_of_window, travelled_m

LIMITS = Limits(
    max_body_bytes=10**6,
    max_window_samples=5,
    max_window_cells=3,
    max_batch_windows=10,
    event_poll_interval_s=1.0,
    event_keep_alive_s=1.0,
)
READINGS = st.one_of(
    st.none(), st.sampled_from([-156.0, -31.0, -156.1, -30.9, 127.0]), st.floats(-150, -40)
)
WAYS = st.floats(allow_nan=False, allow_infinity=False) | st.integers(0, 9).map(float)


@st.composite
def requests(draw: st.DrawFn) -> LocateRequest:
    """Windows that are right, nearly right, or wrong in several ways."""
    samples, cells = draw(st.integers(0, 6)), draw(st.integers(0, 4))

    def column(values: st.SearchStrategy[float]) -> list[float]:
        size = draw(st.sampled_from([samples] * 6 + [samples + 1]))
        found = draw(st.lists(values, min_size=size, max_size=size))
        return sorted(found) if draw(st.integers(0, 3)) else found

    rows = [
        draw(
            st.lists(READINGS, min_size=(n := draw(st.sampled_from([cells] * 9 + [1]))), max_size=n)
        )
        for _ in range(samples)
    ]
    way = draw(st.sampled_from(["distance", "time", "time", "both", "none", "half"]))
    speed = (
        draw(st.sampled_from([0.0, 8.3, -1.0, 151.0]) | st.just([])) if way != "distance" else None
    )
    if speed == []:
        speed = column(st.floats(-1, 160))
    return LocateRequest.model_construct(
        cells=draw(st.lists(st.sampled_from("abcde"), min_size=cells, max_size=cells)),
        rsrp_dbm=rows,
        distance_m=column(WAYS) if way in {"distance", "both"} else None,
        time_s=column(WAYS) if way in {"time", "both", "half"} else None,
        speed_mps=speed if way in {"time", "both"} else None,
        confidence=0.68,
        max_candidates=None,
    )


@given(requests())
def test_the_quick_look_refuses_what_the_slow_one_does(request_: LocateRequest):
    """A window is clean exactly when no fault can be spelled out."""
    with np.errstate(over="ignore", invalid="ignore"):
        clean = _clean_window(request_, LIMITS)
        faults = faults_of_window(request_, LIMITS)
    assert (clean is None) == bool(faults.count), faults.kept


@given(st.lists(st.floats(0, 60), min_size=2, max_size=9), st.floats(0, 40))
def test_a_steady_speed_travels_speed_times_time(steps_s: list[float], speed_mps: float):
    """One speed and the same speed at each sample are the same way."""
    time_s = np.cumsum(steps_s)
    way_m = travelled_m(time_s, np.asarray(speed_mps))
    np.testing.assert_allclose(way_m, speed_mps * (time_s - time_s[0]), atol=1e-9)
    np.testing.assert_array_equal(way_m, travelled_m(time_s, np.full(len(steps_s), speed_mps)))
