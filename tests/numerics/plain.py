"""
The likelihood in plain loops: one place, one sample, one cell, one offset at a time.

Written from `docs`' and the module's words, not from its arrays: nothing here is shared with
`app.numerics` but the constants.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np

from app.domain import RoadModel, Window
from app.numerics.carriers import NOTHING_KNOWN
from app.numerics.listing import FEW, LEAST, MOST, USUAL
from app.numerics.observation import (
    BACKGROUND_SPAN_DB,
    CORRELATION_M,
    HEARD_FLOOR,
    HEARING_WEIGHT,
    OUTSIDE_HEARD,
)
from app.numerics.offsets import (
    APART_SHARE,
    BROAD_OFFSET_SD_DB,
    BROAD_OFFSET_SHARE,
    GROUP_OFFSET_SD_DB,
)

OFFSETS_DB = np.arange(-60.0, 60.01, 0.05)
OWN_DB = np.arange(-40.0, 40.01, 0.2)  # of one group of cells


@dataclass(frozen=True)
class Reading:
    """
    What a vehicle heard on one metre: level and share of samples that heard, per cell, and for how
    much it counts that it heard no others.
    """

    behind_m: float
    level_dbm: dict[str, float]
    share: dict[str, float]
    silence: float = 1.0


def readings(window: Window, known: set[str], models: tuple[RoadModel, ...]) -> list[Reading]:
    """The map's cells metre by metre, newest first; if many more than usual, the strongest."""
    rsrp_dbm = []
    for row in window.rsrp_dbm.tolist():
        heard = zip(window.cells, row, strict=True)
        rsrp_dbm.append({c: dbm for c, dbm in heard if c in known and not math.isnan(dbm)})
    found = _metres(window, rsrp_dbm)
    times = _times_usual(found, models)
    if times > MOST:
        found = _metres(window, [_strongest(one, models) for one in rsrp_dbm])
        times = _times_usual(found, models)
    counts = min(max((times - FEW) / (USUAL - FEW), LEAST), 1.0)
    return [replace(one, silence=counts) for one in found]


def _metres(window: Window, rsrp_dbm: list[dict[str, float]]) -> list[Reading]:
    metres: list[list[int]] = []
    behind_m = window.distance_m[-1] - window.distance_m
    for sample in reversed(range(len(behind_m))):
        metre = math.floor(behind_m[sample] + 0.5)
        if metres and math.floor(behind_m[metres[-1][0]] + 0.5) == metre:
            metres[-1].append(sample)
        else:
            metres.append([sample])
    found = []
    for samples in metres:
        level_dbm, share = {}, {}
        for cell in window.cells:
            heard = [rsrp_dbm[s][cell] for s in samples if cell in rsrp_dbm[s]]
            if heard:
                level_dbm[cell] = sum(heard) / len(heard)
                share[cell] = len(heard) / len(samples)
        found.append(Reading(sum(behind_m[s] for s in samples) / len(samples), level_dbm, share))
    return found


def _strongest(sample: dict[str, float], models: tuple[RoadModel, ...]) -> dict[str, float]:
    """As many of each carrier as its cells are usually listed, one at least."""
    kept = {}
    for carrier in {_carrier(cell) for cell in sample}:
        own = [cell for cell in sample if _carrier(cell) == carrier]
        most = max(round(sum(_usual(cell, models) for cell in own) / len(own)), 1)
        loudest = sorted(own, key=lambda cell: -sample[cell])[:most]
        kept |= {cell: sample[cell] for cell in loudest}
    return kept


def _times_usual(found: list[Reading], models: tuple[RoadModel, ...]) -> float:
    """How many times as many cells as usual it lists of the carriers that it hears."""
    listed = usually = 0.0
    for one, weight in zip(found, weights(found), strict=True):
        for carrier in {_carrier(cell) for cell in one.share}:
            own = {cell: share for cell, share in one.share.items() if _carrier(cell) == carrier}
            listed += weight * sum(own.values())
            usual = sum(share * _usual(cell, models) for cell, share in own.items())
            usually += weight * usual / sum(own.values())
    return listed / usually if usually > 0.0 else 1.0


@cache
def _usual(cell: str, models: tuple[RoadModel, ...]) -> float:
    """How many of its carrier's cells are heard where it is known."""
    numbers = []
    for model in models:
        if cell not in model.cells:
            continue
        alike = [c for c in range(len(model.cells)) if _carrier(model.cells[c]) == _carrier(cell)]
        for at in range(len(model.mean_dbm)):
            if not math.isnan(model.mean_dbm[at, model.cells.index(cell)]):
                there = [c for c in alike if not math.isnan(model.mean_dbm[at, c])]
                numbers.append(sum(float(model.heard[at, c]) for c in there))
    return sum(numbers) / len(numbers) if numbers else 0.0


def weights(found: list[Reading]) -> list[float]:
    """How much each counts: its share of the correlation length, at most 1."""
    if len(found) == 1:
        return [1.0]
    at_m = [one.behind_m for one in found]
    gaps_m = [b - a for a, b in pairwise(at_m)]
    either = [
        (gaps_m[max(i - 1, 0)] + gaps_m[min(i, len(gaps_m) - 1)]) / 2 for i in range(len(at_m))
    ]
    return [min(one / CORRELATION_M, 1.0) for one in either]


def newcomers(models: tuple[RoadModel, ...], model: RoadModel) -> frozenset[str]:
    """Cells heard on none of the days on which the model's road heard any cell of the carrier."""
    out = set()
    for cell in {cell for one in models for cell in one.cells}:
        alike = [c for c in model.cells if _carrier(c) == _carrier(cell)]
        listened = {day for c in alike for day in _days(model, c)}
        on_air = {day for one in models if cell in one.cells for day in _days(one, cell)}
        if listened and "" not in listened | on_air and not listened & on_air:
            out.add(cell)
    return frozenset(out)


def _days(model: RoadModel, cell: str) -> list[str]:
    at = model.cells.index(cell)
    return [day for day, heard in model.heard_on.items() if heard[at]] if model.heard_on else [""]


def log_likelihood(
    model: RoadModel,
    found: list[Reading],
    place: int,
    sign: int,
    offset_db: float,
    only: str | None = None,
    new: frozenset[str] = frozenset(),
) -> float:
    """
    Of a window that ends at a grid position, less that of the background.

    ``only`` names the carrier or the cell that the offset is of; None = it is of all.
    """
    total = 0.0
    for one, weight in zip(found, weights(found), strict=True):
        beyond, near = math.modf(one.behind_m / model.step_m)
        for at, share in ((near, 1.0 - beyond), (near + 1.0, beyond)):
            where = place - sign * int(at)
            if 0 <= where < len(model.mean_dbm):
                said = _one_place(model, one, where, offset_db, only, new)
            else:
                said = HEARING_WEIGHT * sum(one.share.values()) * math.log(OUTSIDE_HEARD)
            total += share * weight * said
    return total


def _carrier(cell: str) -> str:
    return cell[: cell.rfind(":")] if ":" in cell else ""


def _one_place(
    model: RoadModel,
    one: Reading,
    at: int,
    offset_db: float,
    only: str | None,
    new: frozenset[str],
) -> float:
    total = 0.0
    listened = {_carrier(cell) for cell, share in one.share.items() if share > 0.0}
    for column, cell in enumerate(model.cells):
        mapped = not math.isnan(model.mean_dbm[at, column])
        if mapped and _carrier(cell) in listened:
            total += HEARING_WEIGHT * one.silence * math.log(1.0 - _chance(model, at, cell))
    for cell, share in one.share.items():
        chance = 0.5 if cell in new else _chance(model, at, cell)
        total += HEARING_WEIGHT * share * math.log(chance / (1.0 - chance))
        column = model.cells.index(cell) if cell in model.cells else None
        if column is not None and not math.isnan(model.mean_dbm[at, column]):
            mean, spread = float(model.mean_dbm[at, column]), float(model.spread_db[at, column])
            moved = offset_db if only in (None, cell, _carrier(cell)) else 0.0
            z = (one.level_dbm[cell] - mean - moved) / spread
            density = -0.5 * z * z - math.log(spread * math.sqrt(2.0 * math.pi))
            total += share * (density - math.log(1.0 / BACKGROUND_SPAN_DB))
    return total


def _chance(model: RoadModel, at: int, cell: str) -> float:
    """Of hearing a cell there, given its carrier, to which perhaps nobody listened."""
    alike = [c for c in model.cells if _carrier(c) == _carrier(cell)]
    unmapped = [c for c in alike if math.isnan(model.mean_dbm[at, model.cells.index(c)])]
    if cell in alike and cell not in unmapped:
        chance = float(model.heard[at, model.cells.index(cell)])
        return min(max(chance, HEARD_FLOOR), 1.0 - HEARD_FLOOR)
    if not alike:
        return NOTHING_KNOWN
    known = [float(model.heard[at, model.cells.index(c)]) for c in unmapped]
    return min(max([HEARD_FLOOR, *known]), NOTHING_KNOWN)


def offset_prior(offset_sd_db: float) -> np.ndarray:
    """Density of the device's offset at `OFFSETS_DB`."""
    broad_db = max(BROAD_OFFSET_SD_DB, offset_sd_db)
    parts = ((offset_sd_db, 1.0 - BROAD_OFFSET_SHARE), (broad_db, BROAD_OFFSET_SHARE))
    return sum(
        share * np.exp(-0.5 * (OFFSETS_DB / sd) ** 2) / (sd * math.sqrt(2.0 * math.pi))
        for sd, share in parts
    )


def marginal(
    model: RoadModel,
    found: list[Reading],
    place: int,
    sign: int,
    offset_sd_db: float,
    temperature: float = 1.0,
    new: frozenset[str] = frozenset(),
    *,
    carriers: bool = False,
) -> tuple[float, float]:
    """
    Log likelihood with the offsets integrated out numerically, and the mean of the device's.

    Readings are tempered before the prior meets them. ``carriers``: each has an offset of its own;
    without, there is one, and the cells each have their own in `APART_SHARE` of all cases. The mean
    is that of the others.
    """
    at = log_likelihood(model, found, place, sign, 0.0, None, new)
    together, apart = (np.full(len(OFFSETS_DB), at / temperature) for _ in range(2))
    heard = {cell for one in found for cell in one.share}
    for group in {_carrier(cell) for cell in heard} if carriers else heard:
        said = [log_likelihood(model, found, place, sign, b, group, new) for b in (-1.0, 1.0)]
        slope, bend = (said[1] - said[0]) / 2.0, said[1] + said[0] - 2.0 * at
        together += (slope * OFFSETS_DB + 0.5 * bend * OFFSETS_DB**2) / temperature
        apart += _with_own(slope / temperature, bend / temperature)
    hypotheses = (
        ((0.0, together), (1.0, apart))
        if carriers
        else ((1.0 - APART_SHARE, together), (APART_SHARE, apart))
    )
    top = max(together.max(), apart.max())
    mass = [share * np.exp(log - top) * offset_prior(offset_sd_db) for share, log in hypotheses]
    step_db = OFFSETS_DB[1] - OFFSETS_DB[0]
    mean_db = float((mass[carriers] * OFFSETS_DB).sum() / mass[carriers].sum())
    return temperature * float(np.log(sum(mass).sum() * step_db) + top), mean_db


def _with_own(slope: float, bend: float) -> np.ndarray:
    """Log of what a group says of each device offset, its own about it integrated out."""
    offset_db = OFFSETS_DB[:, None] + OWN_DB
    log = slope * offset_db + 0.5 * bend * offset_db**2 - 0.5 * (OWN_DB / GROUP_OFFSET_SD_DB) ** 2
    top = log.max(axis=1)
    scale = (OWN_DB[1] - OWN_DB[0]) / (GROUP_OFFSET_SD_DB * math.sqrt(2.0 * math.pi))
    return np.log(np.exp(log - top[:, None]).sum(axis=1) * scale) + top


def posterior(
    models: tuple[RoadModel, ...], window: Window, offset_sd_db: float, temperature: float
) -> Counter[tuple[str, int, int]]:
    """Probability of every road, direction and grid position, uniform per metre beforehand."""
    known = {cell for model in models for cell in model.cells}
    found = readings(window, known, models)
    score = {
        (model.road_id, sign, place): marginal(
            model, found, place, sign, offset_sd_db, temperature, newcomers(models, model)
        )[0]
        for model in models
        for sign in (1, -1)
        for place in range(len(model.mean_dbm))
    }
    best = max(score.values())
    mass = {where: math.exp((one - best) / temperature) for where, one in score.items()}
    total = sum(mass.values())
    return Counter({where: one / total for where, one in mass.items()})
