"""How probable levels are on a road of which nothing is known: by the book, and the same in C."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.numerics import native, native_laws
from app.numerics.elsewhere import (
    FIELD_M,
    FIELD_SD_DB,
    MEAN_SD_DB,
    NOISE_DB,
    log_evidence,
    or_featureless,
)
from app.numerics.observation import BACKGROUND_SPAN_DB, CENTRE_DBM, Evidence, evidence
from tests.numerics.test_native import built

WINDOWS = (
    st.integers(0, 10_000),
    st.integers(1, 40),
    st.integers(0, 5),
    st.sampled_from([0.1, 0.8, 1.0, 13.0]),
)


def made_up(seed: int, samples: int, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Distances with stops among them, and levels of which some are missing."""
    rng = np.random.default_rng(seed)
    distance_m = np.cumsum(rng.choice([0.0, 0.3, 1.0, 7.0, 30.0], samples))
    rsrp_dbm = CENTRE_DBM + rng.normal(0.0, 12.0, (samples, cells))
    rsrp_dbm[rng.random(rsrp_dbm.shape) < 0.3] = np.nan
    return distance_m, rsrp_dbm


def by_the_book(seen: Evidence, temperature: float) -> float:
    """The Gaussian law of each cell's readings as a whole, each of its own noise."""
    total = 0.0
    for cell in range(seen.heard.shape[1]):
        count = seen.weight * seen.heard[:, cell] / min(temperature, 1.0)
        heard = count > 0.0
        count, level_db, at_m = count[heard], seen.rsrp_db[heard, cell], seen.behind_m[heard]
        noise_db2 = NOISE_DB**2 / count
        apart_m = np.abs(at_m[:, None] - at_m)
        law = FIELD_SD_DB**2 * np.exp(-apart_m / FIELD_M) + MEAN_SD_DB**2 + np.diag(noise_db2)
        total -= 0.5 * level_db @ np.linalg.solve(law, level_db)
        total -= 0.5 * np.linalg.slogdet(2.0 * np.pi * law)[1]
        # A density to the power of w is one of noise / w, but for this factor.
        whole = np.log(2.0 * np.pi * NOISE_DB**2)
        total += 0.5 * float(np.sum(np.log(2.0 * np.pi * noise_db2) - count * whole))
        total += float(count.sum()) * np.log(BACKGROUND_SPAN_DB)
    return total


@settings(max_examples=100, deadline=None)
@given(*WINDOWS)
def test_the_filter_is_the_law_by_the_book(seed, samples, cells, temperature):
    """Readings missing, cars standing, no cell at all."""
    distance_m, rsrp_dbm = made_up(seed, samples, cells)
    seen = evidence(distance_m, rsrp_dbm, 1.0, np.zeros(cells, dtype=int))
    expected = by_the_book(seen, temperature)
    assert log_evidence(seen, temperature) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@built
@settings(max_examples=100, deadline=None)
@given(*WINDOWS)
def test_the_kernel_says_the_same(seed, samples, cells, temperature):
    """Of the evidence as the kernels have it."""
    distance_m, rsrp_dbm = made_up(seed, samples, cells)
    told, seen = native.evidence(
        distance_m, rsrp_dbm, [*range(cells)], 1.0, [0] * cells, [*range(cells)]
    )
    expected = log_evidence(seen, temperature)
    found = native_laws.log_evidence(told, temperature)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


@built
def test_long_windows_of_many_cells_lose_nothing():
    """Products of thousands of spreads leave the range of a double unless taken apart."""
    distance_m, rsrp_dbm = made_up(3, 2000, 30)
    told, seen = native.evidence(distance_m, rsrp_dbm, [*range(30)], 0.1, [0] * 30, [*range(30)])
    assert native_laws.log_evidence(told, 1.0) == pytest.approx(log_evidence(seen), rel=1e-9)


def test_levels_that_change_faster_than_levels_do_are_improbable():
    """Fifteen dB up and down every ten metres, against the same levels in order."""
    distance_m = np.arange(20) * 10.0
    jumping = CENTRE_DBM + np.tile([-15.0, 15.0], 10)[:, None]
    rising = np.sort(jumping, axis=0)
    flat = np.full_like(jumping, CENTRE_DBM)
    found = [
        log_evidence(evidence(distance_m, each, 1.0, np.zeros(1, dtype=int)))
        for each in (jumping, rising, flat)
    ]
    assert found[0] < found[1] - 10.0 < found[2] - 20.0


def test_what_follows_no_law_is_a_background():
    """A share of the prior, where levels jump as no levels do; else as the law has it."""
    assert or_featureless(-500.0) == pytest.approx(np.log(0.05))
    assert or_featureless(30.0) == pytest.approx(30.0 + np.log(0.95))
    assert or_featureless(0.0) == pytest.approx(0.0)
