"""From scores of places to probabilities, positions and radii."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

RADIUS_STEPS = np.linspace(0.0, 1.0, 17)
NEGLIGIBLE = 1e-4  # lighter places move a radius less than it is worth, unless there are many
SPARED = 0.02  # of the posterior: where lighter places hold more together, all of them count
RADIUS_SDS = 4.0  # the radius lies this near the one that would hold if places were points


CHAINAGE, WIDTH, SCORE, RESIDUAL, WEIGHT, APART = range(6)  # rows of `Places.values`
VALUES = 6


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """
    Where a window may end, and how well it fits there; one column a place.

    Attributes:
        where: Road number, and +1 for travel towards growing chainage or -1 against.
        values: Rows in the order of the names above: chainage of the window's last sample in
            metres; length of road that the place stands for, its prior weight, as any metre of the
            map is as likely as any other; log likelihood against the background; residual and
            weight for the device offset, and how probably groups of cells have their own, see
            `app.numerics.offsets`. Held-out windows, whose scores do not hold offsets yet, have a
            residual and a weight of each group after their scores.
    """

    where: Int[np.ndarray, "2 places"]
    values: Float[np.ndarray, "values places"]

    def __len__(self) -> int:
        return self.where.shape[1]

    @property
    def road(self) -> Int[np.ndarray, " places"]:
        """Road number."""
        return self.where[0]

    @property
    def sign(self) -> Int[np.ndarray, " places"]:
        """Direction of travel."""
        return self.where[1]

    @property
    def chainage_m(self) -> Float[np.ndarray, " places"]:
        """Chainage of the window's last sample."""
        return self.values[CHAINAGE]

    @property
    def width_m(self) -> Float[np.ndarray, " places"]:
        """Length of road that the place stands for."""
        return self.values[WIDTH]

    @property
    def score(self) -> Float[np.ndarray, " places"]:
        """Log likelihood against the background."""
        return self.values[SCORE]

    @classmethod
    def join(cls, parts: Sequence[Places]) -> Places:
        """All places of several lists, in order."""
        return cls(
            np.concatenate([part.where for part in parts], axis=1),
            np.concatenate([part.values for part in parts], axis=1),
        )

    def slice(self, first: int, end: int) -> Places:
        """Places ``first`` to ``end - 1``."""
        return Places(self.where[:, first:end], self.values[:, first:end])

    def take(self, kept: np.ndarray) -> Places:
        """The places that a mask or indices name."""
        where, values = self.where[:, kept], self.values[:, kept]
        return Places(np.ascontiguousarray(where), np.ascontiguousarray(values))


class Known(NamedTuple):
    """
    What is known of the last of some places.

    Attributes:
        log_prior: Beforehand, against any metre of the map: it is in their scores times the
            window's temperature.
        factor: What the window's distances are multiplied by there.
    """

    log_prior: Float[np.ndarray, " last"]
    factor: Float[np.ndarray, " last"]


def raised(places: Places, by: Float[np.ndarray, " places"]) -> Places:
    """The places with so much more score: what was known of them beforehand."""
    values = places.values.copy()
    values[SCORE] += by
    return Places(places.where, values)


def masses(places: Places, temperature: float) -> Float[np.ndarray, " places"]:
    """
    Posterior of every place, summing to 1: Bayes' rule with a uniform prior per metre.

    Args:
        temperature: What the map's held-out windows say the scores must be divided by.
    """
    weight = np.exp((places.score - places.score.max()) / temperature) * places.width_m
    return np.asarray(weight / weight.sum())


def kept_by_mass(
    score: Float[np.ndarray, " places"], temperature: float, left_out: float, most: int
) -> Int[np.ndarray, " kept"]:
    """
    The fewest places that leave out at most a share ``left_out`` of the posterior.

    Args:
        most: No more than this many, whatever they leave out; then the most probable ones.

    Returns:
        Indices, increasing.
    """
    weight = np.exp((score - score.max()) * (1.0 / temperature))
    total = float(weight.sum())
    # Places under the floor hold less than half of left_out together: sort the others only.
    likely = (weight >= 0.5 * left_out * total / len(score)).nonzero()[0]
    order = likely[(-weight[likely]).argsort(kind="stable")]
    enough = int(weight[order].cumsum().searchsorted((1.0 - left_out) * total)) + 1
    kept = order[: min(enough, most)]
    kept.sort()
    return np.asarray(kept)


@dataclass(frozen=True, slots=True, eq=False)
class Heaviest:
    """
    The places that carry the posterior.

    Attributes:
        rows: Indices, increasing.
        whole: Whether they leave out no more than may be left out of any answer.
        total: Weight of all places, where the best one's is 1.
    """

    rows: Int[np.ndarray, " rows"]
    whole: bool
    total: float


def heaviest(
    score: Float[np.ndarray, " places"],
    temperature: float,
    left_out: tuple[float, float],
    most: int,
) -> Heaviest:
    """
    The fewest places that leave out at most a share ``left_out[0]`` of the posterior, if these are
    no more than ``most``; else those that leave out ``left_out[1]``, ``most`` at most.
    """
    total = float(np.exp((score - score.max()) * (1.0 / temperature)).sum())
    rows = kept_by_mass(score, temperature, left_out[0], most + 1)
    if len(rows) <= most:
        return Heaviest(rows, True, total)
    return Heaviest(kept_by_mass(score, temperature, left_out[1], most), False, total)


def radius_m(
    away_m: Float[np.ndarray, " places"],
    mass: Float[np.ndarray, " places"],
    width_m: Float[np.ndarray, " places"],
    confidence: float,
    position_sd_m: float,
) -> float:
    """
    Radius about the reported position that holds ``confidence`` of the mass.

    The mass of a place at distance ``d`` lies about it as ``N(d, sd^2)``, where ``sd`` joins the
    place's own length of road and the error of surveyed positions; a radius ``R`` holds
    ``Phi((R - d) / sd) - Phi((-R - d) / sd)`` of it.

    Args:
        away_m: Distance of each place from the reported position.
        position_sd_m: Error of surveyed positions along the road.
    """
    matter = that_matter(mass)
    away_m, mass = away_m[matter], mass[matter]
    sd_m = spread_m(width_m[matter], position_sd_m)
    order = away_m.argsort(kind="stable")
    covered = mass[order].cumsum()
    confidence *= float(covered[-1])
    middle = float(away_m[order[min(int(covered.searchsorted(confidence)), len(order) - 1)]])
    reach = RADIUS_SDS * float(sd_m.max())
    least = max(middle - reach, 0.0)
    centre = away_m / sd_m

    def held(radii: Float[np.ndarray, " radii"]) -> Float[np.ndarray, " radii"]:
        z = radii[:, None] / sd_m
        return np.asarray((normal_share(z - centre) - normal_share(-z - centre)) @ mass)

    radii = least + (middle + reach - least) * RADIUS_STEPS
    shares = held(radii)
    about = np.interp(confidence, shares, radii, left=radii[0], right=radii[-1])
    after = int(radii.searchsorted(about, side="right"))
    radii = np.insert(radii, after, about)
    return float(np.interp(confidence, np.insert(shares, after, held(radii[[after]])), radii))


def that_matter(mass: Float[np.ndarray, " places"]) -> Int[np.ndarray, " heavy"]:
    """Indices of the places that are not negligible."""
    light = mass <= NEGLIGIBLE
    if float(mass[light].sum()) > SPARED:
        return np.arange(len(mass))
    return (~light).nonzero()[0]


def spread_m(width_m: Float[np.ndarray, " places"], sd_m: float) -> Float[np.ndarray, " places"]:
    """Standard deviation of places as wide as these, each of which errs by ``sd_m``."""
    return np.asarray(np.sqrt(width_m**2 * (1.0 / 12.0) + sd_m**2))


def normal_share(z: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Standard normal distribution function, within 3e-4 (Page 1977)."""
    return np.asarray(0.5 + 0.5 * np.tanh(z * (0.7978846 + 0.035677 * z * z)))
