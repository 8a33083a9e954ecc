"""
How many cells a device lists: what it does not list is not always silent.

Survey tools list a dozen cells a second, many phones the serving cell and a neighbour or two. That
such a phone does not list a cell says that others are stronger, not that it is not there: taken for
silence it speaks for roads where little is heard. So where a window lists fewer cells of the
carriers that it hears than the surveys did, silence counts for less. What it lists speaks as ever.

The other way round, a map of a survey that listed few cells lacks most of what such a window hears,
almost anywhere. Of a window that lists many more than the surveys did, each sample's strongest are
kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from app.domain import RoadModel
from app.numerics import carriers
from app.numerics.observation import Evidence

# Of survey passes held out by day 5 % of windows of 100 m list under 0.66 of what is usual, half of
# them under 0.56, 0.40 and 0.27 with the strongest four, two cells and one left of each second.
USUAL = 0.7  # from here on a window lists as surveys do, and silence counts in full
FEW = 0.2  # down to here it counts for less
LEAST = 0.1  # as little as that, however few are listed
MOST = 1.7  # times the usual; one in two hundred windows of such passes lists more


def usual_numbers(models: Sequence[RoadModel]) -> dict[str, float]:
    """
    How many cells of its carrier a survey's sample lists where each cell is known, that lists any.

    A mean over all places of the map that know the cell: what roads elsewhere hear says nothing.
    """
    listed: dict[str, float] = {}
    places: dict[str, int] = {}
    for model in models:
        mapped = ~np.isnan(model.mean_dbm)
        heard = np.where(mapped, model.heard, 0.0)
        carrier = carriers.numbers(model.cells)
        number = (heard @ np.eye(carriers.count(carrier))[carrier])[:, carrier]
        sums = np.where(mapped, number, 0.0).sum(axis=0).tolist()
        for cell, each, there in zip(model.cells, sums, mapped.sum(axis=0).tolist(), strict=True):
            listed[cell] = listed.get(cell, 0.0) + each
            places[cell] = places.get(cell, 0) + there
    return {cell: listed[cell] / max(places[cell], 1) for cell in listed}


def times_usual(seen: Evidence, usual: Float[np.ndarray, " cells"]) -> float:
    """
    How many times as many cells as usual a window lists of the carriers that it hears; 1 where it
    hears nothing.

    Args:
        usual: How many cells of its carrier a sample usually lists where each cell is known.
    """
    listed = float(seen.weight @ seen.heard.sum(axis=1))
    usually = float(seen.weight @ (seen.share @ usual))
    return listed / usually if usually > 0.0 else 1.0


def silence_counts(times: float) -> float:
    """For how much it counts that a window of so many times the usual cells lists no others."""
    return min(max((times - FEW) / (USUAL - FEW), LEAST), 1.0)


def as_listed(seen: Evidence, usual: Float[np.ndarray, " cells"]) -> tuple[Evidence, float]:
    """The window with its silence counting for so much, and `times_usual`."""
    times = times_usual(seen, usual)
    return replace(seen, share=seen.share * silence_counts(times)), times


def strongest(
    rsrp_dbm: Float[np.ndarray, "samples cells"],
    carrier: Int[np.ndarray, " cells"],
    usual: Float[np.ndarray, " cells"],
) -> Float[np.ndarray, "samples cells"]:
    """
    Of each sample and carrier the strongest cells alone, as many as usual: what a survey's phone
    would have listed. NaN are the others.
    """
    kept_dbm = np.full(rsrp_dbm.shape, np.nan)
    for number in range(int(carrier.max(initial=-1)) + 1):
        own = np.flatnonzero(carrier == number)
        level_dbm = rsrp_dbm[:, own]
        heard = ~np.isnan(level_dbm)
        count = np.maximum(heard.sum(axis=1), 1)
        most = np.maximum(np.rint((heard @ usual[own]) / count), 1.0)
        order = np.argsort(np.where(heard, -level_dbm, np.inf), axis=1, kind="stable")
        rank = np.argsort(order, axis=1)
        kept_dbm[:, own] = np.where(rank < most[:, None], level_dbm, np.nan)
    return kept_dbm
