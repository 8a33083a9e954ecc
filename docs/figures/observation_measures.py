"""Numbers of docs/algorithms/observation-model.md: residuals, hearing, offsets, repetition."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from datetime import date
from itertools import combinations

import numpy as np
from observation_data import Driven, Laid
from scipy.stats import t as student

from app.numerics.geodesy import Floats
from app.numerics.passes import RoadPass

Numbers = dict[str, float]
Rows = list[Numbers]

LAGS_M = np.array([0.5, 6, 12, 18, 25, 35, 50, 70, 100, 140, 200, 280, 400])
SHARES = (0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95)
BY = ((1, 1), (2, 3), (4, 6))
FEWEST = 200  # readings that a row of a table rests on
TOGETHER_M = 3.0  # two passes' readings of one cell this near each other are of one place


def flat(laid: Sequence[Laid], name: str) -> Floats:
    """A matrix of every pass, one value a row and cell."""
    return np.concatenate([getattr(one, name).ravel() for one in laid])


def spread_by_passes(laid: Sequence[Laid]) -> Rows:
    """Residuals by how many passes of the map heard the cell at the place."""
    residual_db, spread_db = flat(laid, "residual_db"), flat(laid, "spread_db")
    passes, known = flat(laid, "passes"), ~np.isnan(residual_db)
    rows = []
    for count in range(1, 8):
        here = known & (passes == count)
        if here.sum() >= FEWEST:
            rows.append({"passes": count, **_spread(residual_db[here], spread_db[here])})
    return rows


def _spread(residual_db: Floats, spread_db: Floats) -> Numbers:
    z = residual_db / spread_db
    return {
        "readings": len(z),
        "rms_db": _rms(residual_db),
        "robust_db": float(np.median(np.abs(residual_db)) / 0.6745),
        "said_db": _rms(spread_db),
        "z_square": float(np.mean(z**2)),
        "kurtosis": float(np.mean(z**4) / np.mean(z**2) ** 2),
        "beyond_3": float(np.mean(np.abs(z) > 3.0)),
    }


def spread_by_said(laid: Sequence[Laid], bins: int = 10) -> Rows:
    """Found spread where the map says one or another, cells that three passes or more heard."""
    residual_db, spread_db = flat(laid, "residual_db"), flat(laid, "spread_db")
    here = ~np.isnan(residual_db) & (flat(laid, "passes") >= 3)
    residual_db, spread_db = residual_db[here], spread_db[here]
    order = np.argsort(spread_db)
    return [
        {"said_db": _rms(spread_db[part]), "rms_db": _rms(residual_db[part])}
        for part in np.array_split(order, bins)
    ]


def spread_by_level(laid: Sequence[Laid]) -> Rows:
    """The same by the level expected."""
    residual_db, level_dbm = flat(laid, "residual_db"), flat(laid, "level_dbm")
    known = ~np.isnan(residual_db) & (flat(laid, "passes") >= 3)
    rows = []
    for low in range(-125, -75, 5):
        here = known & (level_dbm >= low) & (level_dbm < low + 5)
        if here.sum() >= FEWEST:
            rows.append({"level_dbm": low + 2.5, "rms_db": _rms(residual_db[here])})
    return rows


def spread_of_cells(laid: Sequence[Laid]) -> Numbers:
    """Quantiles of the spread over cells of a road, and over stretches of 100 m."""
    cells: dict[tuple[str, str], list[Floats]] = {}
    places: dict[tuple[str, int], list[Floats]] = {}
    for one in laid:
        for column, cell in enumerate(one.cells):
            cells.setdefault((one.driven.road_id, cell), []).append(one.residual_db[:, column])
        for row, block in zip(one.residual_db, (one.chainage_m // 100.0).astype(int), strict=True):
            places.setdefault((one.driven.road_id, int(block)), []).append(row)
    found = {}
    for name, groups in (("cell", cells), ("place", places)):
        joined = [np.concatenate(parts) for parts in groups.values()]
        rms = [_rms(each[~np.isnan(each)]) for each in joined if (~np.isnan(each)).sum() >= 100]
        for share in (10, 50, 90):
            found[f"{name}_p{share}_db"] = float(np.percentile(rms, share))
        found[f"{name}s"] = len(rms)
    return found


def correlation(laid: Sequence[Laid]) -> Rows:
    """
    How alike residuals are by the distance between two rows of a pass, over their variance: of one
    cell, of two cells of one carrier, of two of different ones; and how alike hearing errors are.
    """
    kinds = ("same_cell", "same_carrier", "other_carrier", "hearing")
    sums = {kind: np.zeros((2, len(LAGS_M))) for kind in kinds}
    square = {"level": np.zeros(2), "hearing": np.zeros(2)}
    for one in laid:
        z, error = np.nan_to_num(one.z), _hearing_error(one)
        known, mapped = ~np.isnan(one.z), ~np.isnan(one.level_dbm)
        square["level"] += (z**2).sum(), known.sum()
        square["hearing"] += (error**2).sum(), mapped.sum()
        carriers = np.array([cell.partition(":")[0] for cell in one.cells])
        for lag in range(min(80, len(z))):
            ahead, behind = slice(lag, None), slice(0, len(z) - lag)
            apart_m = np.abs(one.chainage_m[ahead] - one.chainage_m[behind])
            bins = np.digitize(apart_m, LAGS_M)
            parts = {
                "same_cell": (_dots(z, ahead, behind), _dots(known, ahead, behind)),
                "hearing": (_dots(error, ahead, behind), _dots(mapped, ahead, behind)),
            }
            parts |= _across(z, known, carriers, (ahead, behind), parts["same_cell"])
            for kind, (product, count) in parts.items():
                for row, weights in enumerate((product, count)):
                    sums[kind][row] += np.bincount(bins, weights, len(LAGS_M) + 1)[: len(LAGS_M)]
    unit = {kind: square["hearing" if kind == "hearing" else "level"] for kind in kinds}
    middle_m = np.concatenate([[0.0], np.sqrt(LAGS_M[1:-1] * LAGS_M[2:])])
    middle_m = np.insert(middle_m, 1, 3.5)
    return [
        {"apart_m": float(middle_m[lag])}
        | {
            kind: float(total / count / (unit[kind][0] / unit[kind][1]))
            for kind in kinds
            for total, count in [sums[kind][:, lag]]
        }
        for lag in range(len(LAGS_M))
    ]


def _dots(values: np.ndarray, ahead: slice, behind: slice) -> Floats:
    return np.asarray((values[ahead].astype(float) * values[behind]).sum(axis=1))


def _across(
    z: Floats,
    known: np.ndarray,
    carriers: np.ndarray,
    rows: tuple[slice, slice],
    own: tuple[Floats, Floats],
) -> dict[str, tuple[Floats, Floats]]:
    """Products of different cells, summed by row: of one carrier, and of different ones."""
    ahead, behind = rows
    whole = [v[ahead].sum(axis=1) * v[behind].sum(axis=1) for v in (z, known.astype(float))]
    one = [np.zeros_like(whole[0]), np.zeros_like(whole[1])]
    for carrier in np.unique(carriers):
        mine = carriers == carrier
        for total, v in zip(one, (z[:, mine], known[:, mine].astype(float)), strict=True):
            np.add(total, v[ahead].sum(axis=1) * v[behind].sum(axis=1), out=total)
    return {
        "same_carrier": (one[0] - own[0], one[1] - own[1]),
        "other_carrier": (whole[0] - one[0], whole[1] - one[1]),
    }


def _hearing_error(one: Laid) -> Floats:
    """Heard or not less the probability, in standard deviations; 0 where the cell is unmapped."""
    chance = one.served
    scale = np.sqrt(np.clip(chance * (1.0 - chance), 0.02, 1.0))
    return np.where(np.isnan(one.level_dbm), 0.0, (one.heard - chance) / scale)


def hearing_by_share(laid: Sequence[Laid], name: str) -> list[Rows]:
    """Reliability of a hearing probability by how many passes drove by: said, true, rows."""
    said, heard = flat(laid, name), flat(laid, "heard")
    by = np.concatenate([np.repeat(one.by, len(one.cells)) for one in laid])
    mapped = ~np.isnan(flat(laid, "level_dbm"))
    tables = []
    for low, high in BY:
        here = mapped & (by >= low) & (by <= high)
        edges = (0.0, *SHARES, 1.01)
        bins = np.digitize(said[here], edges)
        tables.append(
            [
                {
                    "said": float(said[here][bins == each].mean()),
                    "true": float(heard[here][bins == each].mean()),
                    "rows": int((bins == each).sum()),
                }
                for each in range(1, len(edges))
                if (bins == each).sum() >= FEWEST
            ]
        )
    return tables


def hearing_losses(laid: Sequence[Laid]) -> Rows:
    """Mean logarithmic loss of both probabilities, and how often an unmapped cell is heard."""
    heard, mapped = flat(laid, "heard"), ~np.isnan(flat(laid, "level_dbm"))
    by = np.concatenate([np.repeat(one.by, len(one.cells)) for one in laid])
    rows = []
    for low, high in BY:
        here = (by >= low) & (by <= high)
        row: Numbers = {"from": low, "to": high}
        for name in ("share", "served"):
            chance = np.clip(flat(laid, name)[here & mapped], 0.02, 0.98)
            truth = heard[here & mapped]
            losses = truth * np.log(chance) + (1.0 - truth) * np.log(1.0 - chance)
            row[f"{name}_loss"] = -float(losses.mean())
        row["unmapped_heard"] = float(heard[here & ~mapped].mean())
        rows.append(row)
    return rows


def heard_together(laid: Sequence[Laid]) -> Numbers:
    """Variance of the number of cells heard about what is expected, against independent cells."""
    excess, alone, counts = [], [], []
    for one in laid:
        mapped = ~np.isnan(one.level_dbm)
        chance = np.where(mapped, one.served, 0.0)
        heard = np.where(mapped, one.heard > 0.0, 0.0).sum(axis=1)
        counts.append(heard)
        excess.append(heard - chance.sum(axis=1))
        alone.append((chance * (1.0 - chance)).sum(axis=1))
    return {
        "cells": float(np.concatenate(counts).mean()),
        "variance": float(np.concatenate(excess).var()),
        "independent": float(np.concatenate(alone).mean()),
    }


def direction(laid: Sequence[Laid]) -> Rows:
    """Residuals and hearing where the map's passes all went one way: this pass's, or the other."""
    residual_db, heard = flat(laid, "residual_db"), flat(laid, "heard")
    alike, opposite = flat(laid, "alike"), flat(laid, "opposite")
    known, mapped = ~np.isnan(residual_db), ~np.isnan(flat(laid, "level_dbm"))
    rows = []
    for count in (1, 2, 3):
        row: Numbers = {"passes": count}
        for name, one, none in (("alike", alike, opposite), ("opposite", opposite, alike)):
            here = (one == count) & (none == 0)
            row[f"{name}_rms_db"] = _rms(residual_db[here & known])
            row[f"{name}_readings"] = int((here & known).sum())
            row[f"{name}_heard"] = float(heard[here & mapped].mean())
        rows.append(row)
    return rows


def offsets(laid: Sequence[Laid]) -> tuple[list[tuple[str, str, float]], Numbers]:
    """Mean residual of each pass, weighted by its spreads; and what passes have in common."""
    each = [(one.driven, *(_mean(one, part) for part in _halves(one))) for one in laid]
    told = sorted(
        (str(one.driven.trace.recorded_at), one.driven.session, _mean(one, slice(None)))
        for one in laid
    )
    whole = np.array([_mean(one, slice(None)) for one in laid])

    def shared(alike: Callable[[Driven, Driven], bool]) -> float:
        pairs = [
            whole[i] * whole[j]
            for i, j in combinations(range(len(laid)), 2)
            if laid[i].driven.road_id != laid[j].driven.road_id
            and alike(laid[i].driven, laid[j].driven)
        ]
        return float(np.mean(pairs))

    return told, {
        "sd_db": float(whole.std()),
        "halves_db2": float(np.mean([first * second for _, first, second in each])),
        "same_drive_db2": shared(lambda a, b: a.session == b.session),
        "same_day_db2": shared(lambda a, b: a.day == b.day and a.session != b.session),
        "other_day_db2": shared(lambda a, b: a.day != b.day),
    }


def _halves(one: Laid) -> tuple[slice, slice]:
    middle = len(one.chainage_m) // 2
    return slice(0, middle), slice(middle, None)


def _mean(one: Laid, rows: slice) -> float:
    weight = np.where(np.isnan(one.residual_db), 0.0, one.spread_db**-2.0)[rows]
    weight = np.nan_to_num(weight)
    return float((np.nan_to_num(one.residual_db[rows]) * weight).sum() / max(weight.sum(), 1e-9))


def between_passes(roads: dict[str, list[tuple[Driven, RoadPass]]]) -> Rows:
    """
    Differences of two passes at one place and cell, no map in between, by days and direction:
    their spread over the square root of 2, and how much of it is one level for all cells.
    """
    found: dict[tuple[str, str], list[tuple[Floats, float]]] = {}
    for pairs in roads.values():
        for (one, here), (other, there) in combinations(pairs, 2):
            difference_db = np.concatenate(list(_differences(here, there)) or [np.zeros(0)])
            if len(difference_db) < 30:
                continue
            days = abs((date.fromisoformat(one.day) - date.fromisoformat(other.day)).days)
            gap = next(name for most, name in GAPS if days <= most)
            way = "same way" if here.sign == there.sign else "opposite"
            found.setdefault((gap, way), []).append((difference_db, float(difference_db.mean())))
    return [
        {
            "gap": gap,
            "way": way,
            "pairs": len(parts),
            "spread_db": _rms(np.concatenate([part for part, _ in parts])) / np.sqrt(2.0),
            "offset_db": _rms(np.array([mean for _, mean in parts])) / np.sqrt(2.0),
        }
        for (gap, way), parts in sorted(found.items())
    ]


GAPS = ((0, "0 same day"), (2, "1 to 2 days"), (7, "3 to 7 days"), (99, "8 to 17 days"))


def _differences(here: RoadPass, there: RoadPass) -> Iterator[Floats]:
    order = np.argsort(there.chainage_m)
    along_m = there.chainage_m[order]
    for row, chainage_m in enumerate(here.chainage_m):
        near = int(np.searchsorted(along_m, chainage_m))
        close = [i for i in (near - 1, near) if 0 <= i < len(along_m)]
        best = min(close, key=lambda i: abs(along_m[i] - chainage_m))
        if abs(along_m[best] - chainage_m) <= TOGETHER_M:
            apart_db = here.rsrp_dbm[row] - there.rsrp_dbm[order[best]]
            yield apart_db[~np.isnan(apart_db)]


def standing(driven: Sequence[Driven], seconds: Sequence[int] = (1, 2, 3, 5, 8, 15, 30)) -> Rows:
    """Differences of one cell's readings while the car stands, by the time between them."""
    rows = []
    for apart_s in seconds:
        parts, same = [], 0
        for one in driven:
            trace = one.trace
            time_s = trace.time_s
            later = np.searchsorted(time_s, time_s + apart_s)
            pairs = [
                (i, j)
                for i, j in enumerate(later.tolist())
                if j < len(time_s)
                and abs(time_s[j] - time_s[i] - apart_s) < 0.1
                and np.ptp(trace.lon[i : j + 1]) < 1e-5  # a metre
                and np.ptp(trace.lat[i : j + 1]) < 1e-5
            ]
            if pairs:
                first, second = np.array(pairs).T
                apart_db = (trace.rsrp_dbm[second] - trace.rsrp_dbm[first]).astype(float)
                apart_db = apart_db[~np.isnan(apart_db)]
                same += int((np.abs(apart_db) < 1e-3).sum())
                parts.append(apart_db)
        joined = np.concatenate(parts)
        rows.append(
            {
                "apart_s": apart_s,
                "pairs": len(joined),
                "spread_db": _rms(joined) / np.sqrt(2.0),
                "exactly_the_same": same / len(joined),
            }
        )
    return rows


def steps(driven: Sequence[Driven]) -> Numbers:
    """Share of readings on multiples of a step, as the file's two decimals tell them."""
    every = np.concatenate([one.trace.rsrp_dbm[~np.isnan(one.trace.rsrp_dbm)] for one in driven])
    every = every.astype(float)
    return {
        f"on_{parts}ths": float(
            (np.abs(every * parts - np.rint(every * parts)) / parts < 0.0051).mean()
        )
        for parts in (1, 4, 16, 32)
    }


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float("nan")


def standardised(laid: Sequence[Laid], *, within_pass: bool) -> Floats:
    """
    Residuals of cells that three passes heard, over the spread said.

    Args:
        within_pass: Over each cell's own mean and spread in each pass, where it has 30 readings.
    """
    parts = []
    for one in laid:
        z = np.where(one.passes >= 3, one.z, np.nan)
        if within_pass:
            z = z[:, (~np.isnan(z)).sum(axis=0) >= 30]
            if not z.size:
                continue
            z = (z - np.nanmean(z, axis=0)) / np.nanstd(z, axis=0)
        parts.append(z[~np.isnan(z)])
    return np.concatenate(parts)


def tails(laid: Sequence[Laid]) -> Rows:
    """Kurtosis and the Student distribution that fits, with and without each pass's own spread."""
    rows = []
    for within_pass in (False, True):
        z = standardised(laid, within_pass=within_pass)
        freedom, _, scale = student.fit(z[::7], floc=0.0)
        kurtosis = float(np.mean(z**4) / np.mean(z**2) ** 2)
        row = {"within_pass": float(within_pass), "kurtosis": kurtosis}
        rows.append(row | {"student_freedom": float(freedom), "student_scale": float(scale)})
    return rows
