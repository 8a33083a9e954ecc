"""Small maps of made-up numbers, and windows drawn along them: for twins in plain loops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.domain import Calibration, RadioMap, RoadModel, Window
from app.numerics.index import MapIndex, told_of_others
from tests.factories import line_at, model_of


def tiny_models(seed: int, *, length_m: float = 60.0, step_m: float = 1.0) -> tuple[RoadModel, ...]:
    """Three parallel roads that share some cells; a quarter of each road lacks its first cell."""
    cells = (("a", "b", "c"), ("b", "c", "d"), ("a", "e"))
    made = (
        model_of(
            f"road-{i}",
            seed=seed + i,
            line=line_at(40.0 * i, length_m=length_m),
            cells=names,
            step_m=step_m,
        )
        for i, names in enumerate(cells)
    )
    # A fitted road's grid reaches its end; the made-up one stops at its last whole step.
    return tuple(replace(one, length_m=(len(one.mean_dbm) - 1) * step_m) for one in made)


def on_days(models: tuple[RoadModel, ...], *days: str) -> tuple[RoadModel, ...]:
    """Roads surveyed on a day each, on which all their cells were heard."""
    pairs = zip(models, days, strict=True)
    return tuple(
        replace(one, heard_on={day: np.ones(len(one.cells), dtype=bool)}) for one, day in pairs
    )


def map_of(models: tuple[RoadModel, ...], calibration: Calibration | None = None) -> MapIndex:
    return MapIndex.build(RadioMap(3, models, calibration or Calibration()))


def as_laid(models: tuple[RoadModel, ...]) -> tuple[RoadModel, ...]:
    """The models as a map of them has them: what days and surroundings say is in them."""
    return told_of_others(models).models


def window_along(
    model: RoadModel, seed: int, *, samples: int = 9, sign: int = 1, extra: tuple[str, ...] = ()
) -> Window:
    """Readings 3 dB about a model's curves at irregular distances, some missing, cells shuffled."""
    rng = np.random.default_rng(seed)
    distance_m = np.sort(rng.uniform(0.0, 25.0, samples))
    size = len(model.mean_dbm)
    end = rng.uniform(0.5, 0.95) if sign > 0 else rng.uniform(0.05, 0.5)
    at = end * size - sign * (distance_m[-1] - distance_m) / model.step_m
    rows = np.clip(np.rint(at).astype(int), 0, size - 1)
    level_dbm = model.mean_dbm[rows] + rng.normal(0.0, 3.0, (samples, len(model.cells)))
    level_dbm = np.column_stack([level_dbm, rng.uniform(-110, -80, (samples, len(extra)))])
    level_dbm[rng.random(level_dbm.shape) < 0.2] = np.nan
    level_dbm[0, 0] = -90.0
    cells = (*model.cells, *extra)
    order = rng.permutation(len(cells))
    return Window(tuple(cells[i] for i in order), distance_m, level_dbm[:, order])


def gentle_models(seed: int) -> tuple[RoadModel, ...]:
    """Tiny roads with curves like fitted ones: slopes hold for 5 m, spread and hearing are even."""
    rng = np.random.default_rng(seed)
    models = []
    for model in tiny_models(seed):
        size, cells = model.mean_dbm.shape
        slope = np.repeat(rng.normal(0.0, 0.6, (size // 5 + 1, cells)), 5, axis=0)[:size]
        levels_dbm = (-90.0 + np.cumsum(slope, axis=0)).astype(np.float32)
        spread_db, heard = np.full_like(levels_dbm, 2.0), np.full_like(levels_dbm, 0.9)
        models.append(replace(model, mean_dbm=levels_dbm, spread_db=spread_db, heard=heard))
    return tuple(models)
