"""Driving some streets anew makes the map no worse anywhere, though cells came and went."""

from __future__ import annotations

import jaxtyping
import pytest

from tests.numerics.growing import Grown, grown
from tests.numerics.test_pooling import Asked, ask_in, assert_no_worse, joined, mean_and_error

SEEDS = (31, 32)
RIGHT_M = 20.0
NOISE_SDS = 2.5


@pytest.fixture(autouse=True, scope="module")
def _unchecked_shapes():
    """As in `test_pooling`: every other test checks the shapes of what runs here."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


def asked_of(city: Grown, *, anew: bool, driven: bool) -> Asked:
    """Windows on the streets that are driven anew, or on the others, before that and after."""
    asked = tuple(one for one in city.asked if (one.truth.road_id in city.anew) == anew)
    return ask_in(city.index(city.anew if driven else frozenset()), asked)


@pytest.mark.parametrize("anew", [True, False])
def test_driving_some_streets_anew_makes_no_street_worse(anew):
    """Neither places nor probabilities, on streets driven anew and on all others, paired."""
    before, after = (
        joined([asked_of(grown(seed), anew=anew, driven=driven) for seed in SEEDS])
        for driven in (False, True)
    )
    assert_no_worse(before, after)
    lost = (before.error_m < RIGHT_M).astype(float) - (after.error_m < RIGHT_M)
    mean, error = mean_and_error(lost)
    assert mean <= NOISE_SDS * error
