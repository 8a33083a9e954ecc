"""
A window laid round corners, on both scales.

Coarse: a window that ends some columns past a junction lies with its newer samples on the road it
is on, with the older ones on the road it came by. Both halves are summed once for every arm of a
junction (`app.numerics.turns`); any two arms together are a turn. Fine: the few turns that carry
mass are laid metre by metre (`app.numerics.ways`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int

from app.numerics import carriers, native
from app.numerics.index import MapIndex
from app.numerics.motion import TURN, Leg
from app.numerics.odometer_prior import ROUGH_SDS, scale_sd_of
from app.numerics.offmap import err_apart
from app.numerics.offsets import take_offsets
from app.numerics.paths import Way
from app.numerics.query import Query
from app.numerics.tapes import COARSE_STEPS_M
from app.numerics.turns import TurnLevel
from app.numerics.ways import Reached

LEAST_M = 90.0  # shorter windows are explained as well by many turns, and mostly hold none
EDGE_M = 15.0  # nearer to either end of a window a corner tells nothing
# Of windows that may have turned, where samples err each for itself: few of them tell a corner.
SHORT_M = 20.0
SHORT_EDGE_M = 4.0
TURN_SHARE = TURN  # of having turned at a given junction, relative to having come straight
MOST_CORNERS = 6  # turns that are laid metre by metre, the likeliest ones: bounds a query's time
NEGLIGIBLE = 1e-2  # a turn with less of the coarse posterior than this is not laid
NEVER = -np.inf


@dataclass(frozen=True, slots=True, eq=False)
class Laid:
    """
    A window on the arms of a map, while the tapes are scored.

    Attributes:
        turns: Numbers of the turns whose roads both lie on the window's tapes; None = all.
        parts: Score, and residual and weight of each group, of the half of the window that lies
            on each arm, when it ends 1, 2, ... columns past the junction.
    """

    level: TurnLevel
    step_m: float
    turns: Int[np.ndarray, " turns"] | None
    parts: Float32[np.ndarray, "arms channels ends"]

    def of(self, tape: int) -> LaidArms:
        """One tape's arms, their parts to be filled in."""
        arms = self.level.arms[tape]
        return LaidArms(arms.where, self.parts[arms.first : arms.first + arms.count])


@dataclass(frozen=True, slots=True, eq=False)
class LaidArms:
    """Arms of one tape (`app.numerics.turns.Arms`), and the window's parts on them."""

    where: Int[np.ndarray, "3 arms"]
    parts: Float32[np.ndarray, "arms channels ends"]


@dataclass(frozen=True, slots=True)
class Corner:
    """A turn worth a closer look: its number, and from and to which metre past the junction."""

    turn: int
    first_m: int
    last_m: int


def lay(index: MapIndex, query: Query, size: int, tapes: list[int]) -> Laid:
    """
    Room for a window's halves on the arms.

    Args:
        size: Number of the coarse step.
        tapes: Numbers of the tapes that are scored.
    """
    turns = index.turns
    step_m, level = COARSE_STEPS_M[size], turns.levels[size]
    ends = round(query.length_m / step_m) - 1
    considered: Int[np.ndarray, " turns"] | None = None
    if len(tapes) < len(index.tapes):
        there = np.zeros(len(index.tapes), dtype=bool)
        there[tapes] = True
        considered = (there[turns.tape] & there[turns.from_tape]).nonzero()[0]
    channels = 1 + 2 * carriers.count(query.group)
    parts = np.empty((level.total, channels, ends), dtype=np.float32)
    return Laid(level, step_m, considered, parts)


def score_arms(
    factors: Float32[np.ndarray, "channels samples rows"],
    behind: Int[np.ndarray, " samples"],
    rows: Float32[np.ndarray, "rows columns"],
    arms: LaidArms,
) -> None:
    """
    Fill in what the halves of a window say on a tape's arms.

    Sample ``i`` of a window that ends ``e`` columns past a junction lies ``e - behind[i]`` columns
    past it: on the arm that is driven onto where that is not negative, else on the one before.

    Args:
        behind: Columns of the tape from each sample to the window's end.
        rows: Of the tape's profile, as the factors have them.
    """
    each = np.tensordot(factors, rows, axes=1)
    column, sign, onto = arms.where[:, :, None, None]
    past = np.arange(1, arms.parts.shape[2] + 1)[:, None] - behind
    there = (past >= 0) == (onto == 1)
    sample = np.arange(len(behind))
    half = np.where(there, each[:, sample, column + sign * past], 0.0).sum(axis=-1)
    arms.parts[:] = half.swapaxes(0, 1)


def score_turns(index: MapIndex, query: Query, laid: Laid) -> Float32[np.ndarray, "turns ends"]:
    """Scores of the window round each turn, by columns past the junction; -inf where it cannot."""
    level, count = laid.level, laid.parts.shape[2]
    every = (level.onto, level.off, level.room)
    onto, off, room = every if laid.turns is None else (one[laid.turns] for one in every)
    first = max(int(np.ceil(edge_of(query) / laid.step_m)), 1)
    span = (first, count + 1 - first)
    if query.told is not None:
        return native.score_turns(laid.parts, (onto, off, room), span, query.likelihood(index))
    score, *sums = (laid.parts[onto] + laid.parts[off]).swapaxes(0, 1)
    taken = take_offsets(np.array([one.ravel() for one in sums]), query.prior(index))
    score = score + taken.gain.reshape(score.shape)
    ends = np.arange(1, count + 1)
    there = (ends >= span[0]) & (ends <= span[1]) & (ends <= room[:, None])
    return np.where(there, score, NEVER).astype(np.float32)


def may_turn(index: MapIndex, query: Query, *, strays: bool = False) -> bool:
    """
    Whether the window is long enough to be laid round corners, and there are any.

    Args:
        strays: Its answer along roads leaves it open (`app.numerics.matching.may_have_turned`), so
            that a short one counts, too.
    """
    short = strays and query.length_m >= SHORT_M and err_apart(index.calibration)
    return (short or query.length_m >= LEAST_M) and bool(query.cells) and len(index.turns) > 0


def edge_of(query: Query) -> float:
    """How near to either end of the window a corner may lie, in metres."""
    return EDGE_M if query.length_m >= LEAST_M else SHORT_EDGE_M


def every_corner(index: MapIndex, query: Query, *, strays: bool = False) -> list[Corner]:
    """All turns that the window may have taken, wherever it may end after them: see `may_turn`."""
    every = []
    for turn in range(len(index.turns)) if may_turn(index, query, strays=strays) else ():
        first, last = _ends_of(index, query, turn)
        every += [Corner(turn, first, last)] if first <= last else []
    return every


def _ends_of(index: MapIndex, query: Query, turn: int) -> tuple[int, int]:
    """First and last metre past a turn's junction where the window may end."""
    ways = index.turns.ways
    sign, entered_m = int(ways.sign[turn]), float(ways.entered_m[turn])
    room_m = (index.lengths_m[ways.road[turn]] - entered_m) if sign > 0 else entered_m
    edge_m = edge_of(query)
    return int(np.ceil(edge_m)), int(min(room_m, query.length_m - edge_m))


def worth_laying(
    index: MapIndex,
    query: Query,
    laid: Laid,
    kept: Int[np.ndarray, " kept"],
    mass: Float[np.ndarray, " kept"],
) -> list[Corner]:
    """
    The turns that carry mass, heaviest first, and the metres past the junction to look at.

    Args:
        kept: Which turn and end, of all scores, row by row.
        mass: Of each of them, as a share of the posterior.
    """
    count = laid.parts.shape[2]
    row, end = np.divmod(kept, count)
    total = np.bincount(row, mass)
    order = np.argsort(-total, kind="stable")[:MOST_CORNERS]
    corners = []
    for one in order[total[order] >= NEGLIGIBLE].tolist():
        turn = one if laid.turns is None else int(laid.turns[one])
        ends, shift_m = end[row == one] + 1, float(laid.level.past_m[turn])
        least, most = _ends_of(index, query, turn)
        first = max(int((int(ends.min()) - 1) * laid.step_m + shift_m), least)
        last = min(int((int(ends.max()) + 1) * laid.step_m + shift_m) + 1, most)
        corners += [Corner(turn, first, last)] if first <= last else []
    return corners


def reached(index: MapIndex, query: Query, one: Corner) -> Reached:
    """The way round a turn, and where the window may end after it."""
    least, most = _ends_of(index, query, one.turn)
    farther = math.ceil(-ROUGH_SDS[0] * scale_sd_of(query.distance_error) * query.length_m)
    most = max(min(one.last_m + farther, most), one.last_m)
    return Reached(way_of(index, one.turn), one.first_m, one.last_m, min(least, one.first_m), most)


def way_of(index: MapIndex, turn: int) -> Way:
    """The way round a turn."""
    ways = index.turns.ways
    left_m = float(ways.left_m[turn])
    leg = Leg(int(ways.from_road[turn]), int(ways.from_sign[turn]), left_m, left_m)
    return Way((leg,), int(ways.road[turn]), int(ways.sign[turn]), float(ways.entered_m[turn]))
