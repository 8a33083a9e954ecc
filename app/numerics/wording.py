"""An explanation in sentences: what separated the answer from its runner-up, in dB and metres."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.domain import Fix
from app.numerics.explanation import Account, CellShare, Explanation

MOST_SENTENCES = 3  # cells named; the rest is in the numbers
SMALLEST_SHARE = 0.1  # of the difference that is explained: less is not worth a sentence
STEADY = 0.7  # a mean deviation of so much of its root mean square is one to one side
CLEAR_ODDS = 1e6  # beyond, the model is surer than anybody should be
NOISY = 1.5  # times the surveys' variance: less may be expected of any short window
IN_FULL = 0.995  # what silence counts for: from here on it would be told as all


@dataclass(frozen=True, slots=True)
class Stretch:
    """
    A part of the window in which one cell's readings stray from a place.

    Attributes:
        near_m, far_m: Travelled distance from its newest and oldest sample to the window's end.
        mean_db, rms_db: Of the readings minus what the place has, device offset included.
    """

    near_m: float
    far_m: float
    mean_db: float
    rms_db: float


def sentences(told: Explanation, fix: Fix) -> tuple[str, ...]:
    """
    What a person would say of the answer, most important first.

    An answer off the map is explained by what keeps the window from fitting where it fits best.
    """
    if not told.cells:
        return ("None of the window's cells is on the map: nothing tells one place from another.",)
    if fix.off_map:
        return (_misfit(told, fix), *_astray(told), *_device(told))
    return (_verdict(told), *_corner(told), *_separators(told), *_device(told))


def _device(told: Explanation) -> list[str]:
    """What of the window counts for less, or not at all."""
    said = []
    if told.left_out:
        one, count = told.left_out[-1], len(told.left_out)
        them = "1 reading is" if count == 1 else f"{count} readings are"
        said.append(
            f"{them} left out, which their neighbours contradict: the last one is cell {one.cell} "
            f"at {one.rsrp_dbm:.0f} dBm, {one.behind_m:.0f} m before the end."
        )
    if told.unlisted:
        said.append(
            f"The device lists more cells than the surveys' did: {told.unlisted} readings of the "
            "weakest are left out."
        )
    if told.silence < IN_FULL:
        said.append(
            "The device lists fewer cells than the surveys' did: that others were not heard counts "
            f"for {told.silence:.0%}."
        )
    if told.noise >= NOISY:
        said.append(
            "Readings stray further than the surveys' did, as of a noisier device or an area that "
            f"has changed: variance times {told.noise:.1f} may be expected, and a fix is as much "
            "less sure."
        )
    return said


def _corner(told: Explanation) -> list[str]:
    """Where the window comes from, when it came round a corner."""
    place = told.answer.place
    if place.way is None:
        return []
    leg, since_m = place.way.legs[-1], abs(place.chainage_m - place.way.entered_m)
    off = f"off {told.answer.came_by} at {leg.end_m:.0f} m, {since_m:.0f} m before its end"
    return [f"The window comes round a corner: {off}."]


def _verdict(told: Explanation) -> str:
    rival = told.runner_up
    where = f"{_place(rival)} is the runner-up"
    log_odds = told.difference / told.temperature + told.answer.place.log_prior
    if log_odds < 0:
        return f"{where}; by itself this window fits there e^{-log_odds:.1f} times better."
    if log_odds > math.log(CLEAR_ODDS):
        return f"{where}, over {CLEAR_ODDS:,.0f} times less probable a metre."
    return f"{where}, {math.exp(log_odds):,.3g} times less probable a metre."


def _separators(told: Explanation) -> list[str]:
    """One sentence for each cell that speaks for the answer, or loudly against it."""
    scale = sum(abs(one.total) for one in told.shares)
    said = []
    for one in told.shares[:MOST_SENTENCES]:
        if scale and abs(one.total) >= SMALLEST_SHARE * scale:
            against = "" if one.total > 0 else " This speaks for the runner-up."
            said.append(_separator(told, one) + against)
    beyond = told.runner_up.outside - told.answer.outside
    if beyond > SMALLEST_SHARE:  # it says why there is so little to compare there
        said.insert(0, f"{beyond:.0%} more of the samples would lie beyond the road's end there.")
    return said


def _separator(told: Explanation, one: CellShare) -> str:
    """By level or by hearing, whichever weighs more, of the place that it speaks against."""
    here, there = told.answer, told.runner_up
    if abs(one.hearing) > abs(one.level):
        return _hearing(told, one.cell)
    at = told.cells.index(one.cell)
    gain = (here.told.level - there.told.level)[:, at] * (1.0 if one.total > 0 else -1.0)
    worse, better = (there, here) if one.total > 0 else (here, there)
    found = stretch(told, worse, at, gain)
    if found is None:
        return _hearing(told, one.cell)
    other = _strays(told, better, at, found)
    places = ("there", "at the answer") if one.total > 0 else ("at the answer", "there")
    fits = "" if other is None else f" ({abs(other):.1f} dB off {places[1]})"
    return f"Cell {one.cell} is {_deviation(found)} {places[0]} {_where(found)}{fits}."


def _hearing(told: Explanation, cell: str) -> str:
    here, there = (expected_share(told, one, cell) for one in (told.answer, told.runner_up))
    expects = f"the map has it at {there:.0%} there and at {here:.0%} at the answer"
    if cell not in told.cells:
        return f"Cell {cell} was not heard at all; {expects}."
    heard = float((~np.isnan(told.rsrp_dbm[:, told.cells.index(cell)])).mean())
    return f"Cell {cell} was heard by {heard:.0%} of the samples; {expects}."


def expected_share(told: Explanation, account: Account, cell: str) -> float:
    """Mean probability of hearing a cell at a place."""
    if cell in told.cells:
        column = account.expected.hearing[:, told.cells.index(cell)]
        return float(np.nan_to_num(column).mean())
    return account.silent_hearing.get(cell, 0.0)


def _misfit(told: Explanation, fix: Fix) -> str:
    return (
        f"The window fits no road, not even where it fits best, {_place(told.answer)}: with "
        f"{told.fit:.2f} nats a reading, where its levels have {told.any_road:.2f} on any road"
        f"{_shared(told)}, "
        f"and a device {fix.device_offset_db:+.1f} dB from the surveys' it is off the map with "
        f"probability {fix.off_map_posterior:.3f}."
    )


def _shared(told: Explanation) -> str:
    if told.this_road is None:
        return ""
    return f" (with what readings share, {told.this_road:+.1f} nats in all for this road)"


def _astray(told: Explanation) -> list[str]:
    """The cells that stray furthest from the answer's place, beyond what noise explains."""
    residual_db, spread_db = told.residual_db, told.answer.expected.spread_db
    excess = np.nan_to_num((residual_db / spread_db) ** 2 - 1.0)
    worst = np.argsort(-excess.sum(axis=0), kind="stable")[:MOST_SENTENCES]
    said = []
    for at in worst.tolist():
        found = _stretch_of(told.behind_m[::-1], residual_db[::-1, at], excess[::-1, at])
        if found is not None and excess[:, at].sum() > 0:
            said.append(f"Cell {told.cells[at]} is {_deviation(found)} there {_where(found)}.")
    unmapped = [
        cell
        for at, cell in enumerate(told.cells)
        if not np.nan_to_num(told.answer.expected.hearing[:, at]).any()
    ]
    if unmapped:
        said.append(f"The map has never heard there: {', '.join(unmapped)}.")
    if told.missing:
        said.append(f"Expected there and not heard: {', '.join(told.missing)}.")
    return said


def stretch(
    told: Explanation, account: Account, at: int, gain: Float[np.ndarray, " samples"]
) -> Stretch | None:
    """Where a cell's readings stray from a place: the stretch with the most to gain elsewhere."""
    newest = told.behind_m[::-1]
    column = told.residual_at(account)[::-1, at]
    known = ~np.isnan(column)
    if not known.any():
        return None
    nearest = np.abs(newest[:, None] - told.query.fine.behind_m).argmin(axis=1)
    shared = np.bincount(nearest[known], minlength=len(gain))[nearest]
    each = np.where(known, gain[nearest] / np.maximum(shared, 1), 0.0)
    return _stretch_of(newest, column, each)


def _stretch_of(
    behind_m: Float[np.ndarray, " samples"],
    residual_db: Float[np.ndarray, " samples"],
    gain: Float[np.ndarray, " samples"],
) -> Stretch | None:
    """The unbroken run of samples whose gains add up to most; None without any."""
    known = np.flatnonzero(~np.isnan(residual_db))
    if not len(known):
        return None
    total = np.concatenate(([0.0], np.cumsum(gain[known])))
    lowest = np.minimum.accumulate(total)
    end = int((total - lowest)[1:].argmax()) + 1
    start = int(total[:end].argmin())
    part = known[start:end]
    within_db = residual_db[part]
    return Stretch(
        near_m=float(behind_m[part[0]]),
        far_m=float(behind_m[part[-1]]),
        mean_db=float(within_db.mean()),
        rms_db=float(np.sqrt((within_db**2).mean())),
    )


def _strays(told: Explanation, account: Account, at: int, part: Stretch) -> float | None:
    """Mean deviation at a place over the same stretch; None where the cell is not mapped."""
    within = (told.behind_m >= part.near_m) & (told.behind_m <= part.far_m)
    column = told.residual_at(account)[within, at]
    return float(np.nanmean(column)) if (~np.isnan(column)).any() else None


def _deviation(part: Stretch) -> str:
    if abs(part.mean_db) < STEADY * part.rms_db:
        return f"{part.rms_db:.1f} dB astray (root mean square)"
    return f"{abs(part.mean_db):.1f} dB too {'strong' if part.mean_db > 0 else 'weak'}"


def _where(part: Stretch) -> str:
    if part.far_m < 0.5:
        return "at the last sample"
    if part.near_m < 0.5:
        return f"over the last {part.far_m:.0f} m"
    if part.far_m - part.near_m < 0.5:
        return f"{part.far_m:.0f} m before the last sample"
    return f"from {part.far_m:.0f} to {part.near_m:.0f} m before the last sample"


def _place(account: Account) -> str:
    return f"{account.road_id} at {account.place.chainage_m:.0f} m, {account.direction}"
