"""
Windows of one vehicle, each sharpened by those before it: a Bayes filter.

Predict: the belief moves by the travelled distance (`app.numerics.motion`). Update: every place's
prior is what the moved belief says of it, its likelihood that of the readings which are new.
Condense: the posterior becomes a few modes again (`app.numerics.belief`). Nothing is kept here; the
belief goes with the caller.

For its first `LONGEST_M`, while it has not turned, a track is one window: its readings go with the
caller, too, and are asked together, since a long window knows what short ones have in common. Where
samples err each for itself that goes on with the last `LONGEST_M`, and begins anew on the road that
it has turned onto: there a window is as good as its readings are many, and of what lies farther
back an odometer that errs leaves little.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from app.domain import Candidate, Fix, Window
from app.numerics import native
from app.numerics.answer import answer, fit_of_place
from app.numerics.belief import Belief, Mode, Prior, condense
from app.numerics.carried import joined, latest, unheard
from app.numerics.index import MapIndex
from app.numerics.matching import COARSE_FLATTENING, Coarse, fine_places, located, shortlist
from app.numerics.motion import Branch, Predicted, predict
from app.numerics.observation import CORRELATION_M
from app.numerics.offmap import OFF_MAP_PRIOR, Fit, err_apart, off_map_probability
from app.numerics.posterior import SCORE, Places, masses
from app.numerics.query import LONGEST_M, Query, ask
from app.numerics.refinement import refine
from app.numerics.ways import places_round, turns_within

MOST_TURNS = 12  # windows are laid round this many corners at most, the likeliest ones
MOST_SAID = 12.0  # nats that one window may say against a place: 1 in 160,000
NEWS = 0.4  # of what a later window says: it has its device and its day in common with those before
FITS_NOWHERE = 0.5  # chance of being off the map from which a track is not asked as one window
ELSEWHERE_M = 30.0  # fixes farther apart than this along a road are of different places
TURNED_M = 30.0  # an answer so near to where a branch has turned to has turned
OFF_MAP_BOUNDS = (0.002, 0.2)  # what a track may say of being off the map before it listens


@dataclass(frozen=True, slots=True)
class Tracked:
    """
    A fix, and what it leaves to the next window.

    Attributes:
        heard: Readings that are asked together with the next window's; None = its belief goes on
            alone.
    """

    fix: Fix
    belief: Belief
    heard: Window | None = None


def begin(
    index: MapIndex, window: Window, *, confidence: float = 0.68, in_c: bool = native.BUILT
) -> Tracked:
    """The first window of a track: the fix is `app.numerics.matching.locate`'s, to the last bit."""
    query = ask(index, window, in_c=in_c)
    placed, fix = located(index, query, confidence)
    belief = _belief(index, query, placed.places, fix.off_map_posterior)
    return Tracked(fix, belief, window if query.samples == len(window.distance_m) else None)


def follow(
    index: MapIndex,
    window: Window,
    belief: Belief,
    travelled_m: float,
    *,
    heard: Window | None = None,
    confidence: float = 0.68,
    in_c: bool = native.BUILT,
) -> Tracked:
    """
    A later window of a track.

    Args:
        belief, heard: What the window before left.
        travelled_m: From that window's last sample to this one's. Readings farther back than this
            were heard already and count no second time.
    """
    predicted = predict(index, belief, travelled_m, window.distance_error)
    recent = unheard(window, travelled_m)
    filtered = _filtered(index, recent, belief, predicted, travelled_m, (confidence, in_c))
    if travelled_m <= 0:
        return replace(filtered, heard=heard)
    if heard is None or _turned(index, belief, predicted, filtered.fix):
        return replace(filtered, heard=_begun_anew(index, belief, recent, filtered.fix))
    together, apart = joined(heard, recent, travelled_m), err_apart(index.calibration)
    if together.distance_m[-1] - together.distance_m[0] > LONGEST_M:
        if not apart:
            return filtered
        together = latest(together, LONGEST_M)
    whole = begin(index, together, confidence=confidence, in_c=in_c)
    if whole.fix.off_map_posterior > FITS_NOWHERE:  # driven some other way than along one road
        return replace(filtered, heard=together)
    if apart and _surer(filtered.fix, whole.fix):  # of what was driven before, too
        return replace(filtered, heard=together)
    # The last metres alone may fit badly by chance.
    off_map = min(filtered.fix.off_map_posterior, whole.fix.off_map_posterior)
    return Tracked(_with_off_map(whole.fix, off_map), whole.belief.with_off_map(off_map), together)


def _begun_anew(index: MapIndex, belief: Belief, recent: Window, fix: Fix) -> Window | None:
    """
    The new readings, where samples err each for itself and all of them lie on the road of the fix:
    from here on a track is one window once more.
    """
    if not (err_apart(index.calibration) and belief.modes):
        return None
    before = belief.modes[0]
    here = index.road_ids.index(fix.road_id), fix.direction.sign
    return recent if here == (before.road, before.sign) else None


def _surer(fix: Fix, other: Fix) -> bool:
    """Whether the fix is another place, and more probably right."""
    same = (fix.road_id, fix.direction) == (other.road_id, other.direction)
    if same and abs(fix.chainage_m - other.chainage_m) <= ELSEWHERE_M:
        return False
    return fix.segment_posterior > other.segment_posterior


def _filtered(
    index: MapIndex,
    recent: Window,
    belief: Belief,
    predicted: Predicted,
    travelled_m: float,
    asked: tuple[float, bool],
) -> Tracked:
    """What the new readings make of the belief; ``asked`` is the confidence, and whether in C."""
    confidence, in_c = asked
    query = ask(index, recent, in_c=in_c)
    temperature = query.temperature(index.calibration)
    trust = _trust(index, query, travelled_m)
    stayed, turned = _parted(predicted, query.length_m)
    on_map = max(1.0 - predicted.off_map, 1e-9)
    prior = Prior(index, stayed, predicted.anywhere, on_map)
    places = refine(index, query, _straight(index, query, prior, trust))
    log_prior = prior.log_density(places.road, places.sign, places.chainage_m)
    if turned:
        rounds = [_round(index, query, each, on_map) for each in turned]
        places = Places.join([places, *(each for each, _ in rounds)])
        log_prior = np.concatenate([log_prior, *(log for _, log in rounds)])
    fit = fit_of_place(index, query, places, int(places.score.argmax()))
    places.values[SCORE] = _heeded(places.score, temperature, trust) + temperature * log_prior
    fix = answer(index, query, places, confidence)
    off_map = _off_map(index, query, fit, predicted.off_map, trust)
    learnt = _belief(index, query, places, off_map) if travelled_m > 0 else belief
    return Tracked(_with_off_map(fix, off_map), learnt)


def _turned(index: MapIndex, belief: Belief, predicted: Predicted, fix: Fix) -> bool:
    """Whether the fix lies where a branch has turned to, off the road that was likeliest before."""
    road = index.road_ids.index(fix.road_id)
    if belief.modes and belief.modes[0].road == road:
        return False
    return any(
        one.legs and one.mode.road == road and abs(one.mode.chainage_m - fix.chainage_m) <= TURNED_M
        for one in predicted.branches
    )


def _trust(index: MapIndex, query: Query, travelled_m: float) -> float:
    """
    What the new readings count for, as a share of what the same window says alone.

    Never for more road than was travelled; and what a window says but once, however long it is
    (`Calibration.information_once`), was said by the one before. What both have in common, the
    phone, the day and the lorry beside, is no second witness: `NEWS` was chosen on survey passes.
    """
    alone = query.weight / query.temperature(index.calibration)
    more = min(index.calibration.information_each * query.weight, alone)
    return NEWS * more / alone * min(1.0, travelled_m / (query.weight * CORRELATION_M))


def _parted(predicted: Predicted, length_m: float) -> tuple[list[Mode], list[Branch]]:
    """Modes that a window lies straight along, and branches that it must be laid round."""
    turned = [each for each in predicted.branches if turns_within(each, length_m)][:MOST_TURNS]
    chosen = set(map(id, turned))
    return [each.mode for each in predicted.branches if id(each) not in chosen], turned


def _straight(index: MapIndex, query: Query, prior: Prior, trust: float) -> Places:
    """Places along single roads that matter, given what the belief says of them."""
    temperature = query.temperature(index.calibration)

    def foreseen(coarse: Coarse) -> Coarse:
        log = prior.log_density(coarse.road, coarse.sign, coarse.chainage_m, 0.5 * coarse.step_m)
        heeded = _heeded(coarse.score, temperature, trust)
        # The shortlist flattens what it is told, for coarse scores err; the prior does not.
        weighed = (heeded + COARSE_FLATTENING * temperature * log).astype(coarse.score.dtype)
        return replace(coarse, score=weighed)

    return fine_places(index, query, shortlist(index, query, foreseen=foreseen))


def _round(
    index: MapIndex, query: Query, branch: Branch, on_map: float
) -> tuple[Places, Float[np.ndarray, " places"]]:
    """Places round one branch's corners, and the log of their prior density."""
    places = places_round(index, query, branch)
    prior = Prior(index, [branch.mode], 0.0, on_map)
    return places, prior.log_density(places.road, places.sign, places.chainage_m)


def _heeded(
    score: Float[np.ndarray, " places"], temperature: float, trust: float
) -> Float[np.ndarray, " places"]:
    """
    Scores as far as they are believed beside a track.

    One window may mislead, by a lorry beside the car or by a cell that was rebuilt: however badly
    it fits a place, it speaks no more than `MOST_SAID` against it.
    """
    scaled = trust * (score - score.max()) * (1.0 / temperature)
    return np.asarray(temperature * np.logaddexp(scaled, -MOST_SAID * trust))


def _off_map(index: MapIndex, query: Query, fit: Fit | None, before: float, trust: float) -> float:
    """
    Probability of being off the map, from what it was before the window and how well this fits.

    A window that heard nothing says nothing; alone it would be off the map.
    """
    if not query.cells and not query.unknown:
        return before
    alone = off_map_probability(index.calibration, fit, query.information(index.calibration))
    heard = trust * (_log_odds(alone) - _log_odds(OFF_MAP_PRIOR))
    low, high = OFF_MAP_BOUNDS
    log_odds = _log_odds(min(max(before, low), high)) + heard
    return 1.0 / (1.0 + math.exp(-min(max(log_odds, -30.0), 30.0)))


def _log_odds(probability: float) -> float:
    return math.log(probability) - math.log(max(1.0 - probability, 1e-13))


def _with_off_map(fix: Fix, off_map: float) -> Fix:
    """The fix with another probability of being off the map, the rest shared as it was."""
    share = (1.0 - off_map) / sum(one.posterior for one in fix.candidates)
    return replace(
        fix,
        off_map=off_map > 0.5,
        off_map_posterior=off_map,
        road_posterior=fix.road_posterior * share,
        segment_posterior=fix.segment_posterior * share,
        candidates=tuple([_shared(one, share) for one in fix.candidates]),
    )


def _shared(one: Candidate, share: float) -> Candidate:
    """The candidate with a share of its posterior; `replace` takes four times as long."""
    return Candidate(
        one.road_id,
        one.segment_index,
        one.direction,
        one.posterior * share,
        one.chainage_m,
        one.lon,
        one.lat,
    )


def _belief(index: MapIndex, query: Query, places: Places, off_map: float) -> Belief:
    mass = masses(places, query.temperature(index.calibration))
    return condense(places, mass, off_map)
