"""
What numbers must satisfy, spelled out with places and numbers.

These define what is refused. The hot path calls them only on windows that a quick vectorised look
has found wanting; surveys, which come once, always pass through them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from app.api.faults import MAX_FAULTS, Faults
from app.domain import LTE_RSRP_RANGE_DBM, NR_RSRP_RANGE_DBM
from app.errors import Fault
from app.numerics.geodesy import distance_m

Floats = NDArray[np.float64]

ANY_RSRP_RANGE_DBM = (
    min(LTE_RSRP_RANGE_DBM[0], NR_RSRP_RANGE_DBM[0]),
    max(LTE_RSRP_RANGE_DBM[1], NR_RSRP_RANGE_DBM[1]),
)
RSRP_RANGE_DBM = {
    None: ANY_RSRP_RANGE_DBM,
    "lte": LTE_RSRP_RANGE_DBM,
    "nr": NR_RSRP_RANGE_DBM,
}
# What phones and tools write when they measured nothing; all lie outside the ranges.
FILLERS = {
    -30.0: "a filler of scanners",
    127.0: "Android's filler",
    2147483647.0: "Android's filler",
}
MAX_JUMP_M = 10_000.0  # between successive samples; a car needs minutes for it, a logger seconds


def _add_where(faults: Faults, wrong: NDArray[np.bool_], fault: Callable[[int], Fault]) -> None:
    places = np.flatnonzero(wrong)
    faults.add_many((fault(int(place)) for place in places[:MAX_FAULTS]), places.size)


def check_cells(cells: Sequence[str], faults: Faults) -> None:
    """At least one cell, none twice."""
    if not cells:
        faults.add("/cells", "no cell is named")
    first_at: dict[str, int] = {}
    repeats = [
        (i, first) for i, cell in enumerate(cells) if (first := first_at.setdefault(cell, i)) != i
    ]
    faults.add_many(
        (
            Fault(f"/cells/{i}", f"cell {cells[i]!r} stands at /cells/{first} already")
            for i, first in repeats
        ),
        len(repeats),
    )


def check_length(pointer: str, length: int, samples: int, faults: Faults) -> None:
    """One value a sample."""
    if length != samples:
        faults.add(pointer, f"{length} values for {samples} samples")


def check_rows(rows: Sequence[Sequence[float | None]], cells: int, faults: Faults) -> bool:
    """One number a cell in each row; returns whether that holds, so that a matrix can be made."""
    ragged = [i for i, row in enumerate(rows) if len(row) != cells]
    faults.add_many(
        (Fault(f"/rsrp_dbm/{i}", f"{len(rows[i])} values for {cells} cells") for i in ragged),
        len(ragged),
    )
    return not ragged


def check_rsrp(rsrp_dbm: Floats, radio: str | None, faults: Faults) -> None:
    """Every reading within the range of its radio, or of any when none is named."""
    low_dbm, high_dbm = RSRP_RANGE_DBM[radio]
    wrong = (rsrp_dbm < low_dbm) | (rsrp_dbm > high_dbm)  # NaN is neither
    places = np.argwhere(wrong)
    where = f"{radio.upper()}'s" if radio else "LTE's and NR's"

    def fault(row: int, column: int) -> Fault:
        value = float(rsrp_dbm[row, column])
        filler = f" ({FILLERS[value]}, no reading)" if value in FILLERS else ""
        detail = f"{value:.10g} dBm{filler} is outside {where} {low_dbm:g}..{high_dbm:g} dBm"
        return Fault(f"/rsrp_dbm/{row}/{column}", detail)

    shown = (fault(int(row), int(column)) for row, column in islice(places, MAX_FAULTS))
    faults.add_many(shown, len(places))


def check_rising(pointer: str, values: Floats, unit: str, faults: Faults) -> None:
    """Never smaller than the value before."""
    _add_where(
        faults,
        np.diff(values, prepend=values[:1]) < 0,
        lambda i: Fault(
            f"{pointer}/{i}", f"{values[i]:.10g} {unit} after {values[i - 1]:.10g} {unit}"
        ),
    )


def check_within(
    pointer: str, values: Floats, bounds: tuple[float, float], unit: str, faults: Faults
) -> None:
    """Every value between two bounds, bounds included."""
    low, high = bounds
    _add_where(
        faults,
        (values < low) | (values > high),
        lambda i: Fault(f"{pointer}/{i}", f"{values[i]:.10g} {unit} is outside {low:g}..{high:g}"),
    )


def check_jumps(lon: Floats, lat: Floats, faults: Faults) -> None:
    """No two successive positions further apart than `MAX_JUMP_M`."""
    steps_m = distance_m(lon[:-1], lat[:-1], lon[1:], lat[1:])
    _add_where(
        faults,
        steps_m > MAX_JUMP_M,
        lambda i: Fault(
            f"/lon/{i + 1}",
            f"the position jumps {steps_m[i] / 1000:.1f} km from the sample before; "
            f"{MAX_JUMP_M / 1000:g} km is the most",
        ),
    )
