"""From scores of places to probabilities, positions and radii."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


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
    weight = np.exp((score - score.max()) / temperature)
    total = weight.sum()
    # Places under the floor hold less than half of left_out together: sort the others only.
    likely = np.flatnonzero(weight >= 0.5 * left_out * total / len(score))
    order = likely[np.argsort(-weight[likely], kind="stable")]
    enough = int(np.searchsorted(np.cumsum(weight[order]), (1.0 - left_out) * total)) + 1
    return order[: min(enough, most)]


def radius_m(
    away_m: Float[np.ndarray, " places"],
    mass: Float[np.ndarray, " places"],
    width_m: Float[np.ndarray, " places"],
    confidence: float,
) -> float:
    """
    Radius about the reported position that holds ``confidence`` of the mass.

    A place's mass is spread evenly over its own length of road, so the radius moves smoothly.

    Args:
        away_m: Distance of each place from the reported position.
    """
    half = width_m / 2.0
    near, far = np.maximum(away_m - half, 0.0), away_m + half
    order = np.argsort(far, kind="stable")
    edges = np.concatenate(([0.0], far[order]))
    share = np.clip((edges[:, None] - near) / (far - near), 0.0, 1.0) if len(far) < 200 else None
    if share is None:
        covered = np.concatenate(([0.0], np.cumsum(mass[order])))
    else:
        covered = share @ mass
    return float(np.interp(confidence * covered[-1], covered, edges))
