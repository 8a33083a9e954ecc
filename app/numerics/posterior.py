"""From scores of places to probabilities, positions and radii."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

RADIUS_STEPS = 17
RADIUS_SDS = 4.0  # the radius lies this near the one that would hold if places were points


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """
    Where a window may end, and how well it fits there.

    Attributes:
        road: Road number. All arrays have shape ``(places,)``.
        sign: +1 for travel towards growing chainage, -1 against.
        chainage_m: Chainage of the window's last sample.
        width_m: Length of road that the place stands for: its prior weight, as any metre of the
            map is as likely as any other.
        score: Log likelihood against the background.
        residual, weight: For the device offset, as in `app.numerics.alignment.Aligned`.
    """

    road: Int[np.ndarray, " places"]
    sign: Int[np.ndarray, " places"]
    chainage_m: Float[np.ndarray, " places"]
    width_m: Float[np.ndarray, " places"]
    score: Float[np.ndarray, " places"]
    residual: Float[np.ndarray, " places"]
    weight: Float[np.ndarray, " places"]

    def __len__(self) -> int:
        return len(self.score)

    def take(self, rows: np.ndarray) -> Places:
        """The places at these indices, or where this mask is True."""
        return Places(*(getattr(self, name)[rows] for name in self.__slots__))

    @classmethod
    def join(cls, parts: list[Places]) -> Places:
        """All places of several lists, in order."""
        columns = ([getattr(part, name) for part in parts] for name in cls.__slots__)
        return cls(*(np.concatenate(column) for column in columns))


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
    The fewest places that leave out at most a share ``left_out`` of the posterior, best first.

    Args:
        most: No more than this many, whatever they leave out.
    """
    weight = np.exp((score - score.max()) * (1.0 / temperature))
    total = float(weight.sum())
    # Places under the floor hold less than half of left_out together: sort the others only.
    likely = (weight >= 0.5 * left_out * total / len(score)).nonzero()[0]
    order = likely[(-weight[likely]).argsort(kind="stable")]
    enough = int(weight[order].cumsum().searchsorted((1.0 - left_out) * total)) + 1
    return np.asarray(order[: min(enough, most)])


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
    matter = mass > 1e-5
    away_m, mass = away_m[matter], mass[matter] / mass[matter].sum()
    sd_m = np.sqrt(width_m[matter] ** 2 / 12.0 + position_sd_m**2)
    order = away_m.argsort(kind="stable")
    covered = mass[order].cumsum()
    middle = float(away_m[order][min(int(covered.searchsorted(confidence)), len(order) - 1)])
    reach = RADIUS_SDS * float(sd_m.max())
    radii = np.linspace(max(middle - reach, 0.0), middle + reach, RADIUS_STEPS)
    inner = _normal_share((radii[:, None] - away_m) / sd_m)
    held = (inner - _normal_share((-radii[:, None] - away_m) / sd_m)) @ mass
    return float(np.interp(confidence, held, radii))


def _normal_share(z: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Standard normal distribution function, within 3e-4 (Page 1977)."""
    return np.asarray(0.5 + 0.5 * np.tanh(z * (0.7978846 + 0.035677 * z * z)))
