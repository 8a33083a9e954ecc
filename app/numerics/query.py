"""A window against a map: which of its cells the map knows, ready for every scale."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from app.domain import Calibration, Window
from app.numerics import carriers, native, native_laws, native_readings
from app.numerics.elsewhere import log_evidence, or_featureless
from app.numerics.index import MapIndex
from app.numerics.listing import MOST, as_listed, strongest
from app.numerics.newcomers import Columns
from app.numerics.observation import TERMS, Evidence, coefficients, evidence
from app.numerics.offsets import OffsetPrior
from app.numerics.tapes import COARSE_STEPS_M, GAP
from app.numerics.wild import without_wild

FINE_STEP_M = 1.0
ON_COLUMN = 1e-6  # of a column: samples so near lie at one
LONGEST_M = COARSE_STEPS_M[-1] * (GAP - 1)  # readings farther back than this are not used


@dataclass(frozen=True, slots=True, eq=False)
class Aim:
    """
    A window aimed at one profile.

    Attributes:
        rows: Rows of the profile that the window's cells need; None = all, in order.
        here: Columns of the window that the profile knows, or has a stand-in for; None = all, in
            the profile's order.
        factors: The window's side of the likelihood for these rows, see `coefficients`.
        behind: Columns of the profile from each sample to the window's end, in whole ones.
        share: Of the way from there to the next column behind, where each sample lies.
    """

    rows: Int[np.ndarray, " rows"] | None
    here: Int[np.ndarray, " chosen"] | None
    factors: Float[np.ndarray, "channels samples rows"]
    behind: Int[np.ndarray, " samples"]
    share: Float[np.ndarray, " samples"]

    def cells(self, count: int) -> Int[np.ndarray, " chosen"]:
        """Numbers of the window's cells among the profile's ``count``."""
        return np.arange(count) if self.rows is None else self.rows[:-1:TERMS] // TERMS


@dataclass(frozen=True, eq=False)
class Query:
    """
    The usable part of a window.

    Attributes:
        cells: Heard cells that the map knows, sorted; the columns of ``fine``.
        unknown: Heard cells that it does not know, sorted.
        samples: How many samples of the window these are.
        rsrp_dbm: Their readings of these cells, oldest first, but those that were left out.
        fine: The readings metre by metre.
        group: Number of each cell's group among the window's (`app.numerics.carriers.groups`).
        readings: How many readings these are, each counted by its sample's weight.
        told: The same for the kernels in C; None = all is worked out with numpy.
        distance_error: Of the window's distances, see `app.domain.Window`.
    """

    cells: tuple[str, ...]
    unknown: tuple[str, ...]
    samples: int
    rsrp_dbm: Float[np.ndarray, "samples cells"]
    fine: Evidence
    group: Int[np.ndarray, " cells"]
    readings: float
    told: native.Told | None = None
    distance_error: float | None = None
    _aims: dict[int, Aim] = field(default_factory=dict)
    _temperatures: list[tuple[Calibration, float]] = field(default_factory=list)
    _priors: list[OffsetPrior] = field(default_factory=list)
    _terms: list[native.Likelihood] = field(default_factory=list)
    _numbers: dict[Columns, list[int]] = field(default_factory=dict)

    @cached_property
    def factors(self) -> Float[np.ndarray, "channels samples rows"]:
        """The readings' side of the likelihood."""
        return coefficients(self.fine, self.group)

    def prior(self, index: MapIndex) -> OffsetPrior:
        """What the device's offset may be, for this window; worked out once."""
        if not self._priors:
            self._priors.append(index.offset_prior.at(self.temperature(index.calibration)))
        return self._priors[0]

    def likelihood(self, index: MapIndex) -> native.Likelihood:
        """The same with the constants of the likelihood, for the kernels; worked out once."""
        if not self._terms:
            self._terms.append(native.likelihood(self.prior(index)))
        return self._terms[0]

    @cached_property
    def weight(self) -> float:
        """What the samples weigh together, see `app.numerics.observation.sample_weight`."""
        return float(self.fine.weight.sum())

    def temperature(self, calibration: Calibration) -> float:
        """What the window's scores are divided by; worked out once."""
        known = self._temperatures
        if not known or known[-1][0] is not calibration:
            found = calibration.temperature(self.weight, len(self.fine.weight))
            known.append((calibration, found))
        return known[-1][1]

    def information(self, calibration: Calibration) -> float:
        """How many independent samples the window is worth."""
        return calibration.information(self.weight, len(self.fine.weight))

    def elsewhere(self, calibration: Calibration) -> float:
        """How probable its levels are on a road of which nothing is known, as a log evidence."""
        temperature = self.temperature(calibration)
        if self.told is None:
            return or_featureless(log_evidence(self.fine, temperature))
        return or_featureless(native_laws.log_evidence(self.told, temperature))

    @property
    def length_m(self) -> float:
        """Travelled distance from the oldest usable sample to the last."""
        return float(self.fine.behind_m[-1])

    def multiplied(self, factor: float) -> Query:
        """The window with its distances so much longer, for numpy; what its samples weigh stays."""
        seen = self.fine
        fine = Evidence(seen.behind_m * factor, seen.rsrp_db, seen.heard, seen.share, seen.weight)
        known = (self.cells, self.unknown, self.samples, self.rsrp_dbm)
        return Query(*known, fine, self.group, self.readings)

    def aim(self, column: Columns, step_m: float, *, joined: bool = False) -> Aim:
        """
        Match the window's cells with a profile's rows.

        Args:
            column: Numbers of cells in the profile.
            step_m: Metres between the profile's columns.
            joined: Take every sample to lie at the nearest column and add up those of one, which
                then count as one: fewer products where a column is longer than a sample.
        """
        factors, rows, here = self.factors, None, None
        numbers = self.numbers(column)
        if numbers != list(range(len(column))):
            there = np.array(numbers, dtype=np.intp)
            here = np.flatnonzero(there >= 0)
            rows = _rows_of(there[here], len(column))
            if len(here) < len(numbers):
                factors = factors[:, :, _rows_of(here, len(numbers))]
        behind, share = columns_behind(self.fine.behind_m, step_m, nearest=joined)
        if joined:
            starts = np.concatenate(([0], (behind[1:] != behind[:-1]).nonzero()[0] + 1))
            factors = np.add.reduceat(factors, starts, axis=1)
            behind, share = behind[starts], share[starts]
        return Aim(rows, here, factors, behind, share)

    def aimed(self, told: native.Told, column: Columns) -> native.Aimed:
        """Twin of `aim` for the kernels in C, which do the rest of it themselves."""
        return native.Aimed(told.block, told.samples, self.numbers(column), told.group)

    def numbers(self, column: Columns) -> list[int]:
        """Each cell's column, or that of what stands in for it; -1 = not even that."""
        known = self._numbers.get(column)
        if known is None:
            known = [column.cell.get(cell, -1) for cell in self.cells]
            if -1 in known:
                known = column.filled(known, self.cells, self._stand_ins)
            self._numbers[column] = known
        return known

    @cached_property
    def _stand_ins(self) -> list[str]:
        """Name of what stands for each cell where a profile lacks it."""
        return [carriers.stand_in(carriers.carrier_of(cell)) for cell in self.cells]

    def aim_at(self, index: MapIndex, road: int) -> Aim:
        """The window aimed at one road's fine profile; worked out once a road."""
        found = self._aims.get(road)
        if found is None:
            target = index.roads[road]
            found = self._aims[road] = self.aim(target.column, target.step_m)
        return found


def columns_behind(
    behind_m: Float[np.ndarray, " samples"], step_m: float, *, nearest: bool = False
) -> tuple[Int[np.ndarray, " samples"], Float[np.ndarray, " samples"]]:
    """
    Whole columns from each sample to the window's end, and the share of the way to the next one.

    Args:
        nearest: Take every sample to lie at the nearest column.
    """
    columns = behind_m * (1.0 / step_m)
    at = np.rint(columns)
    between = (np.abs(columns - at) >= ON_COLUMN) & (not nearest)
    whole = np.where(between, np.floor(columns), at)
    return whole.astype(np.intp), np.where(between, columns - whole, 0.0)


def _rows_of(cells: Int[np.ndarray, " chosen"], count: int) -> Int[np.ndarray, " rows"]:
    """A profile's rows of some of its ``count`` cells, with its last one."""
    terms = (cells[:, None] * TERMS + np.arange(TERMS)).ravel()
    return np.concatenate((terms, (TERMS * count,)))


def ask(index: MapIndex, window: Window, *, in_c: bool = False) -> Query:
    """
    Prepare a window; the order of its cells moves nothing.

    Args:
        in_c: Let the kernels in C answer it where they have a twin of the numpy code.
    """
    distance_m = np.ascontiguousarray(window.distance_m, dtype=np.float64)
    rsrp_dbm = np.ascontiguousarray(window.rsrp_dbm, dtype=np.float64)
    if distance_m[-1] - distance_m[0] > LONGEST_M:
        recent = distance_m >= distance_m[-1] - LONGEST_M
        distance_m, rsrp_dbm = distance_m[recent], rsrp_dbm[recent]
    heard = native.heard_columns(rsrp_dbm) if in_c else _heard_columns(rsrp_dbm)
    named = sorted([(window.cells[i], i) for i in heard])
    known = [pair for pair in named if pair[0] in index.cells]
    unknown = () if len(known) == len(named) else _names(p for p in named if p not in known)
    columns, names = [i for _, i in known], _names(known)
    if columns != list(range(len(window.cells))):
        rsrp_dbm = np.ascontiguousarray(rsrp_dbm[:, columns])
    return prepare(index, names, unknown, distance_m, rsrp_dbm, window.distance_error, in_c=in_c)


def _heard_columns(rsrp_dbm: Float[np.ndarray, "samples cells"]) -> list[int]:
    return [int(i) for i in np.flatnonzero(~np.isnan(rsrp_dbm).all(axis=0))]


def _names(pairs: Iterable[tuple[str, int]]) -> tuple[str, ...]:
    return tuple([cell for cell, _ in pairs])


def prepare(
    index: MapIndex,
    cells: tuple[str, ...],
    unknown: tuple[str, ...],
    distance_m: Float[np.ndarray, " samples"],
    rsrp_dbm: Float[np.ndarray, "samples cells"],
    distance_error: float | None = None,
    *,
    in_c: bool = False,
) -> Query:
    """
    A query from readings whose columns are exactly ``cells``, all of them heard: wild ones are left
    out, and those that the surveys would not have listed (`app.numerics.listing`).
    """
    leave_out = native_readings.without_wild if in_c else without_wild
    rsrp_dbm = leave_out(distance_m, rsrp_dbm)
    query, times = _read(index, cells, unknown, distance_m, rsrp_dbm, distance_error, in_c=in_c)
    if times <= MOST:
        return query
    rsrp_dbm = strongest(rsrp_dbm, carriers.numbers(cells), index.usual(cells))
    kept = _heard_columns(rsrp_dbm)
    rsrp_dbm = np.ascontiguousarray(rsrp_dbm[:, kept])
    cells = tuple([cells[column] for column in kept])
    return _read(index, cells, unknown, distance_m, rsrp_dbm, distance_error, in_c=in_c)[0]


def _read(
    index: MapIndex,
    cells: tuple[str, ...],
    unknown: tuple[str, ...],
    distance_m: Float[np.ndarray, " samples"],
    rsrp_dbm: Float[np.ndarray, "samples cells"],
    distance_error: float | None,
    *,
    in_c: bool,
) -> tuple[Query, float]:
    """All these readings, and how many times the usual cells they are of."""
    group, usual, told = index.groups(cells), index.usual(cells), None
    if in_c:
        here, carrier = list(range(len(cells))), [index.carrier[cell] for cell in cells]
        told, fine = native.evidence(
            distance_m, rsrp_dbm, here, FINE_STEP_M, carrier, group.tolist()
        )
        times, readings = native_readings.listen(told, usual)
    else:
        fine = evidence(distance_m, rsrp_dbm, FINE_STEP_M, carriers.numbers(cells))
        fine, times = as_listed(fine, usual)
        readings = float((fine.weight @ fine.heard).sum())
    samples = len(distance_m)
    counted = (fine, group, readings)
    return Query(cells, unknown, samples, rsrp_dbm, *counted, told, distance_error), times
