"""
How late a pass's readings are and how loud its device was, told by the road's other passes.

Radio and position of a receiver have clocks of their own: readings of one drive may belong to
where the car was seconds before, of another to where it went. At 8 m/s a second is the error of a
fix. And a phone that lay elsewhere hears everything louder or fainter. Both show when a pass is
held against the curves of the others. What each is against the others is measured pass by pass, on
a grid of lags with the level integrated out; then all lags are solved for at once, as each is
relative to the others' own, under the prior that days differ and that a day may as well have no lag
at all. A pass moves only where the evidence says so: elsewhere it stays as it is, bit by bit.

Only differences are known between passes that went the same way. Passes of opposite ways that are
late alike lie apart by twice the way, which tells what they have in common.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import CubicSpline

from app.numerics.curves import Basis
from app.numerics.geodesy import Floats
from app.numerics.joint import SMALLEST_PRECISION, Joint, days_apart
from app.numerics.left_out import Others, Readings, leave_out, readings_of
from app.numerics.passes import MAX_LAG_S, RoadPass, Samples

ROUNDS = 3
STEP_S = 0.25
LAGS_S = np.arange(-MAX_LAG_S, MAX_LAG_S + 1e-9, STEP_S)
FINE_S = np.linspace(-MAX_LAG_S, MAX_LAG_S, 481)
TEMPERATURE = 6.0  # by which readings of a pass tell less than if they were independent
LAG_DAY_SD_S, LAG_PASS_SD_S = 0.7, 0.4  # of a day's lag, and of its passes about it
LEVEL_DAY_SD_DB, LEVEL_PASS_SD_DB = 1.6, 1.2
LOG_ODDS_OF_LAG = 0.0  # of a day, before its passes are looked at: half of them have none
LOG_ODDS_OF_LEVEL = -3.0  # of a road's passes differing at all
BROAD_S = 1.5  # a pass's own lag is measured under this much doubt, which is then taken out again
SETTLED_S, SETTLED_DB = 0.01, 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """
    What is to be taken out of each pass.

    Attributes:
        lag_s: How long before its time each reading was taken. Shape ``(passes,)``.
        level_db: How much louder than the road's passes on the whole; weighted by readings they
            sum to 0, so that the map stays as loud as it was.
    """

    lag_s: Float[np.ndarray, " passes"]
    level_db: Float[np.ndarray, " passes"]

    def correct(self, passes: Sequence[RoadPass]) -> list[RoadPass]:
        """The passes with lag and level taken out."""
        told = zip(passes, self.lag_s.tolist(), self.level_db.tolist(), strict=True)
        return [one.corrected(lag_s, level_db) for one, lag_s, level_db in told]


def register(
    passes: Sequence[RoadPass], end_m: float, spacing_m: float, strength: float
) -> Registration:
    """
    Estimate lag and level of every pass of a road.

    Args:
        passes: As they were driven; one alone has nothing to be compared with.
        end_m: Length of the road.
        spacing_m, strength: Knots and penalty of the curves they are held against.
    """
    now = Registration(np.zeros(len(passes)), np.zeros(len(passes)))
    if len(passes) < 2:  # of one pass nothing is known
        return now
    basis = Basis.over(end_m, spacing_m)
    readings, tracks = readings_of(passes), [_Track.of(one, basis) for one in passes]
    for _ in range(ROUNDS):
        found = _round(passes, readings, tracks, (basis, strength), now)
        settled = np.abs(found.lag_s - now.lag_s).max() < SETTLED_S
        settled &= np.abs(found.level_db - now.level_db).max() < SETTLED_DB
        now = found
        if settled:
            break
    return now


@dataclass(frozen=True, slots=True, eq=False)
class _Track:
    """Where a pass's rows would be at each lag."""

    one: RoadPass
    first: np.ndarray
    value: Floats
    metres_per_s: float
    timed: bool

    @classmethod
    def of(cls, one: RoadPass, basis: Basis) -> _Track:
        samples, shape = one.samples, (len(LAGS_S), len(one.chainage_m))
        if samples is None or not samples.timed:
            weights = basis.at(np.tile(one.chainage_m, len(LAGS_S)))
            speed, timed = float(one.sign), False
        else:
            weights = basis.at(np.concatenate([_rows_m(samples, lag) for lag in LAGS_S.tolist()]))
            took_s = float(samples.time_s[-1] - samples.time_s[0])
            speed, timed = one.sign * max(float(one.travelled_m[-1]) / took_s, 1.0), True
        first, value = weights.first.reshape(shape), weights.value.reshape((*shape, -1))
        return cls(one, first, value, speed, timed)

    def at_m(self, lag_s: float) -> Floats:
        """Of each row, its samples' mean."""
        samples = self.one.samples
        if samples is None or lag_s == 0.0:
            return self.one.chainage_m
        return _rows_m(samples, lag_s)


def _rows_m(samples: Samples, lag_s: float) -> Floats:
    starts = samples.starts()
    size = np.diff(np.append(starts, len(samples.time_s)))
    return np.asarray(np.add.reduceat(samples.behind_m(lag_s), starts) / size)


@dataclass(frozen=True, slots=True, eq=False)
class _Told:
    """What one pass says against the others: its lag and its level, each with a precision."""

    lag_s: float
    lag_precision: float
    level_db: float
    level_precision: float


def _round(
    passes: Sequence[RoadPass],
    readings: Sequence[Readings],
    tracks: Sequence[_Track],
    fitting: tuple[Basis, float],
    now: Registration,
) -> Registration:
    basis, strength = fitting
    level = [
        replace(one, rsrp_db=one.rsrp_db - level_db)
        for one, level_db in zip(readings, now.level_db.tolist(), strict=True)
    ]
    places = [one.at_m(lag) for one, lag in zip(tracks, now.lag_s.tolist(), strict=True)]
    others = leave_out(basis, level, places, passes[0].rsrp_dbm.shape[1], strength)
    told = [
        _against(others, number, one, tracks[number], float(now.lag_s[number]))
        for number, one in enumerate(level)
    ]
    day = np.array([[one.group == other.group for other in passes] for one in passes])
    return Registration(
        _lags(told, others.share, tracks, day, now.lag_s),
        _levels(told, others.share, day, readings, now.level_db),
    )


def _against(others: Others, number: int, readings: Readings, track: _Track, lag_s: float) -> _Told:
    """Log likelihood of the pass at every lag, its level integrated out, as two normals."""
    near = int(np.abs(LAGS_S - lag_s).argmin())
    spread_db = others.spread_db(number, readings, track.first[near], track.value[near])
    precision = readings.weight / spread_db**2 / TEMPERATURE
    residual_db = readings.rsrp_db - others.expected_db(number, readings, track.first, track.value)
    total = float(precision.sum())
    shift = residual_db @ precision
    doubt = total + 1.0 / (LEVEL_DAY_SD_DB**2 + LEVEL_PASS_SD_DB**2)
    log_likelihood = -0.5 * ((residual_db**2) @ precision - shift**2 / doubt)
    lag, lag_precision = _moments(log_likelihood) if track.timed else (0.0, 0.0)
    level_db = float(np.interp(lag_s, LAGS_S, shift)) / max(total, SMALLEST_PRECISION)
    return _Told(lag, lag_precision, level_db, total)


def _moments(log_likelihood: Float[np.ndarray, " lags"]) -> tuple[float, float]:
    """Mean and precision of the normal that a likelihood over lags comes down to."""
    fine = CubicSpline(LAGS_S, log_likelihood - log_likelihood.max())(FINE_S)
    log = fine - 0.5 * (FINE_S / BROAD_S) ** 2
    chance = np.exp(log - log.max())
    chance /= chance.sum()
    mean = float(chance @ FINE_S)
    step = FINE_S[1] - FINE_S[0]
    variance = float(chance @ (FINE_S - mean) ** 2) + float(step) ** 2 / 12.0
    precision = 1.0 / variance - 1.0 / BROAD_S**2
    if precision <= SMALLEST_PRECISION:
        return 0.0, 0.0
    return mean / variance / precision, precision


def _lags(
    told: Sequence[_Told],
    share: Floats,
    tracks: Sequence[_Track],
    day: Bool[np.ndarray, "passes passes"],
    now: Floats,
) -> Floats:
    speed = np.array([one.metres_per_s for one in tracks])
    joint = Joint.of(
        np.array([one.lag_s for one in told]),
        np.array([one.lag_precision for one in told]),
        share * speed[None, :] / speed[:, None],
        now,
    )
    timed = np.array([one.timed for one in tracks])
    prior = day * LAG_DAY_SD_S**2 + np.eye(len(told)) * LAG_PASS_SD_S**2
    prior = prior * np.outer(timed, timed)
    late = days_apart(joint, prior, day, LOG_ODDS_OF_LAG)
    lag_s = joint.mean(prior * np.outer(late, late))
    return np.asarray(np.clip(lag_s, -MAX_LAG_S, MAX_LAG_S))


def _levels(
    told: Sequence[_Told],
    share: Floats,
    day: Bool[np.ndarray, "passes passes"],
    readings: Sequence[Readings],
    now: Floats,
) -> Floats:
    joint = Joint.of(
        np.array([one.level_db for one in told]) + now,
        np.array([one.level_precision for one in told]),
        share,
        now,
    )
    prior = day * LEVEL_DAY_SD_DB**2 + np.eye(len(told)) * LEVEL_PASS_SD_DB**2
    none, some = joint.log_evidence(np.stack([np.zeros_like(prior), prior]))
    if some + LOG_ODDS_OF_LEVEL <= none:
        return np.zeros(len(told))
    level_db = joint.mean(prior)
    count = np.array([len(one.row) for one in readings], dtype=float)
    return np.asarray(level_db - float(level_db @ count) / float(count.sum()))
