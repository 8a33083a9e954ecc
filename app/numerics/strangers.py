"""Windows that the map cannot know: drawn from one road's model, asked for in a map without it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from app.domain import RoadModel, Window
from app.numerics.answer import fit_at_best
from app.numerics.index import MapIndex
from app.numerics.matching import fine_places, shortlist
from app.numerics.query import ask

COUNT = 160
LENGTHS_M = (30.0, 60.0, 120.0, 200.0)
SAMPLE_STEP_M = 5.0
SEED = 20_211_105  # strangers are the same for the same models


def stranger_fits(index: MapIndex, models: Sequence[RoadModel]) -> Float[np.ndarray, " windows"]:
    """
    Fit per reading of windows from roads that the map lacks.

    A map of one road has no other to ask; its windows then come with their cells exchanged, as in a
    town where the same names stand for other cells.
    """
    rng = np.random.default_rng(SEED)
    fits = []
    for number in rng.integers(0, len(models), COUNT).tolist():
        alone = len(models) == 1
        window = _drawn(models[number], rng, exchanged=alone)
        query = ask(index, window)
        places = fine_places(index, query, shortlist(index, query, None if alone else number))
        fit = fit_at_best(index, query, places)
        if fit is not None:
            fits.append(fit)
    return np.array(fits)


def _drawn(model: RoadModel, rng: np.random.Generator, *, exchanged: bool) -> Window:
    length_m = min(float(rng.choice(LENGTHS_M)), 0.8 * model.length_m)
    start_m = rng.uniform(0.0, model.length_m - length_m)
    travelled_m = np.arange(0.0, length_m + 1e-9, SAMPLE_STEP_M)
    at = np.minimum(np.rint((start_m + travelled_m) / model.step_m), len(model.heard) - 1)
    rows = at.astype(int)
    heard = rng.random((len(rows), len(model.cells))) < model.heard[rows]
    noise_db = model.spread_db[rows] * rng.standard_normal(heard.shape)
    rsrp_dbm = np.where(heard, model.mean_dbm[rows] + noise_db, np.nan)
    if exchanged:
        rsrp_dbm = rsrp_dbm[:, rng.permutation(len(model.cells))]
    return Window(model.cells, travelled_m, rsrp_dbm)
