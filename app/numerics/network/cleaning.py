"""
Drives without what is no driving: jumps of the receiver, standing cars, jitter, gaps.

What is left are pieces: stretches of a drive in even steps, each step with the sample it was at.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from app.numerics.geodesy import Floats
from app.numerics.network.steps import Piece, piece_of, rounding_m

FASTEST_MPS = 60.0  # no survey car drives 216 km/h...
FASTER = 1.5  # ...nor so many times as fast as it went for nearly all of the drive
SLACK_M = 20.0  # what two fixes of a receiver in a street canyon may add to the way between them
SPIKE_M = 40.0  # a fix whose detour is longer went there and back
STOP_M = 12.0  # jitter of a standing receiver stays within
STOP_S = 8.0
LEFT_AFTER = 3  # fixes in a row elsewhere: one or two are jitter
THINNED_TO_M = 8.0  # closer fixes say more of jitter than of the way
GAP_M = 100.0  # wider, nobody knows which way the car took...
GAP_STEPS = 4.0  # ...unless the receiver reports so rarely


def clean(
    drive: int, xy_m: Float[np.ndarray, "samples 2"], time_s: Float[np.ndarray, " samples"]
) -> list[Piece]:
    """
    Cut a drive into pieces.

    Args:
        drive: The number that its pieces get.
        xy_m: Positions in local metres.
        time_s: Seconds, non-decreasing.

    Returns:
        The pieces in driving order; none of a drive that does not move.
    """
    kept = np.flatnonzero(_plausible(xy_m, time_s))
    kept = kept[_no_spikes(xy_m[kept])]
    anchors = _without_stops(xy_m[kept], time_s[kept])
    rounded_m = rounding_m(xy_m[kept])
    pieces = []
    for part in _parts(anchors.xy_m):
        first, last = kept[anchors.first[part]], kept[anchors.last[part]]
        piece = piece_of(drive, anchors.xy_m[part], rounded_m, first, last)
        if piece is not None:
            pieces.append(piece)
    return pieces


@dataclass(frozen=True, slots=True, eq=False)
class _Anchors:
    """Places of a drive some metres apart, each with the first and last fix taken there."""

    xy_m: Float[np.ndarray, "anchors 2"]
    first: Int[np.ndarray, " anchors"]
    last: Int[np.ndarray, " anchors"]


def _plausible(xy_m: Floats, time_s: Floats) -> Bool[np.ndarray, " samples"]:
    """
    Samples of the longest chain that a car can have driven.

    Impossible steps cut the drive into blocks; the chain is the set of blocks with the most samples
    in which every block can be reached from the one before.
    """
    step_m = np.hypot(*np.diff(xy_m, axis=0).T)
    fastest_mps = _fastest_mps(step_m, np.diff(time_s))
    cuts = np.flatnonzero(step_m > fastest_mps * np.diff(time_s) + SLACK_M) + 1
    starts = np.concatenate([[0], cuts])
    ends = np.append(cuts, len(xy_m))
    best, before = np.zeros(len(starts)), np.full(len(starts), -1)
    for block, start in enumerate(starts):
        away_m = np.hypot(*(xy_m[ends[:block] - 1] - xy_m[start]).T)
        reach_m = fastest_mps * (time_s[start] - time_s[ends[:block] - 1]) + SLACK_M
        value = np.where(away_m <= reach_m, best[:block], -1.0)
        if len(value) and value.max() > 0.0:
            before[block] = int(np.argmax(value))
            best[block] = value.max()
        best[block] += ends[block] - start
    keep = np.zeros(len(xy_m), dtype=bool)
    block = int(np.argmax(best))
    while block >= 0:
        keep[starts[block] : ends[block]] = True
        block = int(before[block])
    return keep


def _fastest_mps(step_m: Floats, took_s: Floats) -> float:
    moved = (took_s > 0.0) & (step_m > 1.0)
    if not moved.any():
        return FASTEST_MPS
    usual = float(np.quantile(step_m[moved] / took_s[moved], 0.95))
    return min(FASTEST_MPS, FASTER * usual)


def _no_spikes(xy_m: Floats) -> Int[np.ndarray, " kept"]:
    """Which fixes do not go there and back between their neighbours."""
    kept = np.arange(len(xy_m))
    for _ in range(3):  # a spike may hide one beside it
        at = xy_m[kept]
        if len(at) < 3:
            break
        step_m = np.hypot(*np.diff(at, axis=0).T)
        straight_m = np.hypot(*(at[2:] - at[:-2]).T)
        spike = step_m[:-1] + step_m[1:] - straight_m > SPIKE_M
        spike &= np.minimum(step_m[:-1], step_m[1:]) > straight_m  # a corner is no spike
        if not spike.any():
            break
        kept = kept[np.concatenate([[True], ~spike, [True]])]
    return kept


def _without_stops(xy_m: Floats, time_s: Floats) -> _Anchors:
    """One anchor where the car stood, and one each `THINNED_TO_M` where it drove."""
    places, first, last = [], [], []
    at = 0
    while at < len(xy_m):
        end = _stands_until(xy_m, at)
        if time_s[end - 1] - time_s[at] >= STOP_S and _stays(xy_m[at:end]):
            places.append(np.median(xy_m[at:end], axis=0))
            first.append(at)
            last.append(end - 1)
            at = end
            continue
        places.append(xy_m[at])
        first.append(at)
        last.append(at)
        at += 1
        while at < end and np.hypot(*(xy_m[at] - places[-1])) < THINNED_TO_M:
            at += 1
    if last[-1] == first[-1] > 0:  # the way ends where the car did, not some metres before
        places[-1], first[-1], last[-1] = xy_m[-1], len(xy_m) - 1, len(xy_m) - 1
    return _Anchors(np.array(places), np.array(first), np.array(last))


def _stays(xy_m: Floats) -> bool:
    """Whether the later fixes lie where the earlier ones did: a crawling car moves on."""
    half = len(xy_m) // 2
    moved = xy_m[:half].mean(axis=0) - xy_m[-half:].mean(axis=0)
    return math.hypot(*moved) <= STOP_M / 2.0


def _stands_until(xy_m: Floats, at: int) -> int:
    """The first of the fixes after ``at`` that leave the place where they were on average."""
    x_m, y_m = xy_m[:, 0], xy_m[:, 1]
    mean_x, mean_y, out = float(x_m[at]), float(y_m[at]), 0
    for end in range(at + 1, len(xy_m)):
        if math.hypot(x_m[end] - mean_x, y_m[end] - mean_y) > STOP_M:
            out += 1
            if out == LEFT_AFTER:
                return end + 1 - LEFT_AFTER
            continue
        out = 0
        weight = 1.0 / (end - at + 1)
        mean_x += weight * (float(x_m[end]) - mean_x)
        mean_y += weight * (float(y_m[end]) - mean_y)
    return len(xy_m) - out


def _parts(xy_m: Floats) -> list[slice]:
    """Stretches of anchors without a gap."""
    step_m = np.hypot(*np.diff(xy_m, axis=0).T)
    if len(step_m) == 0:
        return []
    widest_m = max(GAP_M, GAP_STEPS * float(np.median(step_m)))
    cuts = [0, *(np.flatnonzero(step_m > widest_m) + 1).tolist(), len(xy_m)]
    return [slice(a, b) for a, b in pairwise(cuts) if b - a > 1]
