"""
Places over sub-segments: how much of a place's mass lies beyond the boundaries of its own.

A place stands for some length of road and surveyed positions err, so that its mass lies along the
road about it as ``N(chainage, sd^2)``, see `app.numerics.posterior.spread_m`. What would fall off
the road's ends stays in the sub-segment at that end: no road gains or loses any.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from app.numerics.index import Atlas, Spot
from app.numerics.posterior import Places, normal_share, spread_m, that_matter

REACH_SDS = 4.0  # farther away lies less of a place than matters of a posterior


@dataclass(frozen=True, slots=True, eq=False)
class Shares:
    """
    One entry a place and sub-segment that has a share of it.

    Attributes:
        place: Index of the place; every place is an entry in its own sub-segment.
        chainage_m: Where in the sub-segment the place is likeliest: there, or at the edge next to
            it, if the place lies in another one.
        spilled: Whether it does.
    """

    place: Int[np.ndarray, " shares"]
    segment: Int[np.ndarray, " shares"]
    mass: Float[np.ndarray, " shares"]
    chainage_m: Float[np.ndarray, " shares"]
    spilled: Bool[np.ndarray, " shares"]


def over_segments(
    atlas: Atlas, places: Places, mass: Float[np.ndarray, " places"], spots: Spot, sd_m: float
) -> Shares:
    """
    The masses of places, shared among the sub-segments of their roads; they add up to the same.

    Args:
        spots: Of the places in the atlas.
        sd_m: Error of surveyed positions along the road.
    """
    heavy, own = that_matter(mass), atlas.segment[spots.low]
    sd_of, stays = spread_m(places.width_m, sd_m), np.ones(len(places))  # less what lies beyond
    parts = [(np.arange(len(places)), own, stays, places.chainage_m)]
    for way in (1, -1):
        place, segment = heavy, own[heavy]
        share = _beyond(atlas, places, sd_of, place, segment, way)
        stays[heavy] -= share
        while (reached := share > 0.0).any():
            place, segment, share = place[reached], segment[reached] + way, share[reached]
            farther = _beyond(atlas, places, sd_of, place, segment, way)
            edge_m = atlas.edge_m[atlas.first_edge[places.road[place]] + segment + (way < 0)]
            parts.append((place, segment, share - farther, edge_m))
            share = farther
    place, segment, share, chainage_m = (np.concatenate(e) for e in zip(*parts, strict=True))
    spilled = np.arange(len(place)) >= len(places)
    return Shares(place, segment, mass[place] * share, chainage_m, spilled)


def _beyond(
    atlas: Atlas,
    places: Places,
    sd_m: Float[np.ndarray, " places"],
    place: Int[np.ndarray, " some"],
    segment: Int[np.ndarray, " some"],
    way: int,
) -> Float[np.ndarray, " some"]:
    """Share of places that lies beyond sub-segments, in one direction; none beyond a road's end."""
    road = places.road[place]
    first, end = atlas.first_edge[road], atlas.first_edge[road + 1]
    edge = first + segment + (way > 0)
    z = way * (places.chainage_m[place] - atlas.edge_m[edge]) / sd_m[place]
    inner = (edge > first) & (edge < end - 1)
    return np.where(inner & (z > -REACH_SDS), normal_share(z), 0.0)
