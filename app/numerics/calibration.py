"""
What held-out windows say of a map's probabilities.

Every road model carries its evidence: windows of its own passes, aligned with curves fitted without
them. The temperature and the error of surveyed positions are those that make the truth most
probable (the logarithmic score, which is proper: only honest probabilities maximise it). The spread
of device offsets and how well a window fits that is on the map come from the same windows; how well
one fits that is not, is learnt by asking for each road's windows in a map without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from app.domain import Calibration, RadioMap, RoadModel
from app.numerics.evidence_table import CHOICES, COLUMNS, FIXED_COLUMNS
from app.numerics.geodesy import Floats
from app.numerics.index import MapIndex
from app.numerics.offmap import OFF_MAP_PRIOR
from app.numerics.strangers import stranger_fits

MIN_WINDOWS = 20  # fewer held-out windows say nothing reliable
SMALLEST_OFFSET_SD_DB = 0.5
RIDGE = 3e-5  # next to nothing: it only stops classes that do not overlap from parting for ever


def calibrate(models: Sequence[RoadModel]) -> Calibration:
    """
    Pool the roads' evidence.

    Args:
        models: All roads of the map; those without evidence have no say.

    Returns:
        The defaults where there is too little evidence to say better.
    """
    rows = np.concatenate([np.zeros((0, len(COLUMNS))), *(model.evidence for model in models)])
    if len(rows) < MIN_WINDOWS:
        return Calibration()
    log_density = rows[:, len(FIXED_COLUMNS) :].mean(axis=0)
    temperature, position_sd_m = CHOICES[int(np.argmax(log_density))]
    learnt = Calibration(
        temperature=temperature,
        offset_sd_db=_offset_sd_db(rows),
        position_sd_m=position_sd_m,
        window_count=len(rows),
    )
    strangers = stranger_fits(MapIndex.build(RadioMap(0, tuple(models), learnt)), models)
    intercept, slope = _logistic(rows[:, COLUMNS.index("fit")], strangers)
    return replace(learnt, off_map_intercept=intercept, off_map_slope=slope)


def _offset_sd_db(rows: Float[np.ndarray, "windows columns"]) -> float:
    """Spread of device offsets beyond what the windows' own noise explains."""
    measured = rows[rows[:, COLUMNS.index("measured")] > 0.5]
    if len(measured) < MIN_WINDOWS:
        return Calibration().offset_sd_db
    offset_db = measured[:, COLUMNS.index("offset_db")]
    noise_db2 = measured[:, COLUMNS.index("offset_variance_db2")]
    beyond_db2 = float(np.mean(offset_db**2 - noise_db2))
    return float(np.sqrt(max(beyond_db2, SMALLEST_OFFSET_SD_DB**2)))


def _logistic(on_map: Floats, off_map: Floats) -> tuple[float, float]:
    """
    Intercept and slope of the log odds of being on the map, both classes weighing alike.

    Newton's method with a small ridge, so that classes that do not overlap end at a finite slope;
    the prior `OFF_MAP_PRIOR` then shifts the intercept.
    """
    fit = np.concatenate([on_map, off_map]).astype(float)
    label = np.concatenate([np.ones(len(on_map)), np.zeros(len(off_map))])
    weight = np.where(label > 0, 0.5 / len(on_map), 0.5 / len(off_map))
    centre, scale = float(np.mean(fit)), float(np.std(fit)) + 1e-9
    design = np.column_stack([np.ones_like(fit), (fit - centre) / scale])
    theta = np.zeros(2)
    for _ in range(30):
        chance = 1.0 / (1.0 + np.exp(-design @ theta))
        gradient = design.T @ (weight * (label - chance)) - RIDGE * np.array([0.0, theta[1]])
        curvature = weight * chance * (1.0 - chance)
        hessian = (design.T * curvature) @ design + RIDGE * np.diag([1e-6, 1.0])
        theta = theta + np.linalg.solve(hessian, gradient)
    slope = float(theta[1]) / scale
    prior = float(np.log((1.0 - OFF_MAP_PRIOR) / OFF_MAP_PRIOR))
    return float(theta[0]) - slope * centre + prior, slope
