"""
The error to expect where a window ends, from what coverage and calibration say.

With the device's offset of spread ``sd_b`` as a nuisance, the information about the place is
``I = I_ss - I_sb^2 / (I_bb + 1 / sd_b^2)``. A window's samples share shadowing and what has changed
since the survey, which the calibration knows as a temperature T, and curves of n passes err
themselves by what one pass differs from another. The place then errs by

    sd^2 = T (1 + 1 / n) / I + position_sd^2

and the median error is the one of windows that take the right road with probability q: the m with
``q P(|N(0, sd^2)| <= m) = 1/2``, as a wrong road is farther off than that.
"""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
from jaxtyping import Float, Int

from app.domain import Calibration

WINDOW_M = 200.0  # of the window whose error is told
SAMPLE_M = 10.0  # between its samples: closer ones share shadowing and count as one
FARTHEST_M = 200.0  # no window says less of a place than its own length

# Passes over a place, and the share of windows of 200 m that found their road there: 2,121 windows
# of survey passes held out by day, 17 streets of a grid (docs/surveying.md has the table).
ROAD_RIGHT = ((0, 0.0), (1, 0.78), (2, 0.83), (4, 0.95))


def pass_class(passes: Int[np.ndarray, " places"]) -> Int[np.ndarray, " places"]:
    """Which row of `ROAD_RIGHT` holds for so many passes."""
    return np.searchsorted([least for least, _ in ROAD_RIGHT], passes, side="right") - 1


def road_right(passes: Int[np.ndarray, " places"]) -> Float[np.ndarray, " places"]:
    """Share of windows that find their road where so many passes lie."""
    return np.array([share for _, share in ROAD_RIGHT])[pass_class(passes)]


def expected_sd_m(
    information: Float[np.ndarray, "places 3"],
    passes: Int[np.ndarray, " places"],
    calibration: Calibration,
) -> Float[np.ndarray, " places"]:
    """
    Standard deviation along the road of a fix on the right road.

    Args:
        information: I_ss, I_sb and I_bb (`app.numerics.coverage`); NaN where they are not known.

    Returns:
        Metres, `FARTHEST_M` at most; NaN where the information is, and where nobody drove.
    """
    place, mixed, offset = information.T
    offset_sd_db = max(calibration.offset_sd_db, 1e-2)
    known = place - mixed**2 / (offset + 1.0 / offset_sd_db**2)
    weight = WINDOW_M / SAMPLE_M
    curves = 1.0 + 1.0 / np.where(passes > 0, passes, np.nan)
    temperature = calibration.temperature(weight, round(weight)) * curves
    local_m2 = temperature / np.maximum(known, temperature / FARTHEST_M**2)
    variance_m2 = local_m2 + calibration.position_sd_m**2
    return np.asarray(np.minimum(np.sqrt(variance_m2), FARTHEST_M))


def expected_error_m(
    sd_m: Float[np.ndarray, " places"], right: Float[np.ndarray, " places"]
) -> Float[np.ndarray, " places"]:
    """
    Median distance between fix and truth, wrong roads included.

    Args:
        sd_m: From `expected_sd_m`.
        right: From `road_right`.

    Returns:
        Metres; NaN where ``sd_m`` is, and where no more than half of the windows find their road.
    """
    factor = np.full(len(right), np.nan)
    for share in np.unique(right[right > 0.5]).tolist():
        factor[right == share] = NormalDist().inv_cdf(0.5 + 0.25 / share)
    return np.asarray(factor * sd_m)
