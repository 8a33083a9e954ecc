"""
Carriers: cells that a phone hears, or does not, together.

A phone searches some carriers at a time, and which ones differs from day to day. That none of a
carrier's cells was heard says nothing about the place; that one was, and another was not, does. So
silence counts within a carrier that a sample has heard, and a cell of a carrier that no survey has
heard at a place is unknown there, not absent.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float, Int

NOTHING_KNOWN = 0.25  # chance of a cell whose carrier no survey pass has heard there
NEWCOMER_HEARD = 0.5  # of a cell that a road's days say nothing of: neither for it nor against


def carrier_of(cell: str) -> str:
    """What stands before the last colon of ``earfcn:pci``; cells named otherwise share one."""
    return cell.rpartition(":")[0]


def stand_in(carrier: str) -> str:
    """Name of the column that stands for a carrier's cells which a profile lacks."""
    return f"{carrier}:*"


def numbers(cells: Sequence[str]) -> Int[np.ndarray, " cells"]:
    """Number of each cell's carrier, in the order in which they are first named."""
    known: dict[str, int] = {}
    return np.array([known.setdefault(carrier_of(c), len(known)) for c in cells], dtype=np.intp)


def groups(cells: Sequence[str], carriers: int) -> Int[np.ndarray, " cells"]:
    """
    Number of each cell's group, from 0 on: cells that go astray together (`app.numerics.offsets`).

    Args:
        carriers: How many the map has: several are the groups, of a single one each cell is.
    """
    return numbers(cells) if carriers > 1 else np.arange(len(cells), dtype=np.intp)


def count(group: Int[np.ndarray, " cells"]) -> int:
    """How many groups, or carriers, the cells are of; one where there is no cell."""
    return int(group.max(initial=0)) + 1


def carriers_of(cells: Iterable[str], others: Iterable[str] = ()) -> tuple[str, ...]:
    """The cells' carriers in the order in which they are first named, then ``others``."""
    return tuple(dict.fromkeys([*map(carrier_of, cells), *others]))


def columns_of(cells: Sequence[str], others: Sequence[str] = ()) -> dict[str, int]:
    """
    Number of every cell in a profile of these, then of the stand-in of each carrier.

    Args:
        others: Carriers of other roads, which have stand-ins here, too.
    """
    names = [*cells, *map(stand_in, carriers_of(cells, others))]
    return {name: number for number, name in enumerate(names)}


def unmapped_chance(
    heard: Float[np.ndarray, "columns cells"],
    mean_dbm: Float[np.ndarray, "columns cells"],
    carrier: Int[np.ndarray, " cells"],
    floor: float,
) -> Float[np.ndarray, "columns carriers"]:
    """
    Chance of hearing a cell of each carrier that is not mapped at a place.

    Args:
        heard: Where a cell is not mapped, what is known of its carrier's there.
        carrier: Number of each cell's carrier.
        floor: Where all of a carrier's cells are mapped.
    """
    out = np.full((len(heard), int(carrier.max(initial=-1)) + 1), floor)
    for number in range(out.shape[1]):
        own = carrier == number
        unmapped = np.where(np.isnan(mean_dbm[:, own]), heard[:, own], floor)
        out[:, number] = np.clip(np.nan_to_num(unmapped).max(axis=1), floor, NOTHING_KNOWN)
    return out
