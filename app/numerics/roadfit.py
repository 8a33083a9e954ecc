"""From the passes of one road to its model: the whole offline method, as one pure function."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool

from app.domain import Line, Road, RoadModel, Trace
from app.errors import NoCells, NotEnoughSamples, RoadTooShort
from app.numerics import carriers
from app.numerics.centreline import derive_line
from app.numerics.curves import FittedCurves
from app.numerics.features import feature_matrix
from app.numerics.fitting import Fitting
from app.numerics.heldout import Surface, held_out_evidence
from app.numerics.independence import CHANCES_SDS, Shared, shared_about
from app.numerics.lines import length_m
from app.numerics.passes import RoadPass, all_cells, distinct, lay_on_road
from app.numerics.salience import select_salient
from app.numerics.segmentation import SegmentationParams, cut_road
from app.numerics.subsegments import FittedRoad, describe_segments


@dataclass(frozen=True, slots=True)
class FitParams:
    """
    How a road is fitted.

    Attributes:
        grid_step_m: Step of the grid on which a serving process sees the curves, and distance of
            their knots.
        min_readings: A cell heard in fewer rows has no curve.
        min_rows: Fewer rows on the road make no model.
    """

    grid_step_m: float = 1.0
    min_readings: int = 8
    min_rows: int = 8
    segmentation: SegmentationParams = field(default_factory=SegmentationParams)


def fit_road(road: Road, passes: Sequence[Trace], params: FitParams = FitParams()) -> RoadModel:
    """
    Fit a road: curves, sub-segments, features, salience and evidence.

    Args:
        road: Its line, where it has one; else the passes draw it.
        passes: Survey passes; exact copies count once, and their order moves nothing.

    Raises:
        NotEnoughSamples, NoCells, RoadTooShort: The passes say too little of this road.
    """
    laid = _lay_all(road, passes, params)
    work = _fitting(laid, params)
    fitted = _fit(laid.passes, work)
    reference = _reference(laid.cells, laid.traces, fitted.surface)
    return _assemble(road, laid, work, fitted, reference, params)


@dataclass(frozen=True, slots=True, eq=False)
class RegisteredPass:
    """What was taken out of a pass before the fit; see `app.numerics.registration`."""

    trace: Trace
    lag_s: float
    level_db: float


def register_road(
    road: Road, passes: Sequence[Trace], params: FitParams = FitParams()
) -> list[RegisteredPass]:
    """
    Lag and level of a road's passes, as `fit_road` takes them out; of copies, one.

    Raises:
        NotEnoughSamples, NoCells, RoadTooShort: The passes say too little of this road.
    """
    laid = _lay_all(road, passes, params)
    work = _fitting(laid, params)
    found = work.registration(laid.passes, work.curves(laid.passes).strength)
    told = zip(laid.traces, found.lag_s.tolist(), found.level_db.tolist(), strict=True)
    return [RegisteredPass(*each) for each in told]


@dataclass(frozen=True, slots=True, eq=False)
class _Laid:
    """Passes on the road's line as they were driven, with the cells heard often enough."""

    line: Line
    cells: tuple[str, ...]
    passes: list[RoadPass]
    traces: list[Trace]


def _lay_all(road: Road, every: Sequence[Trace], params: FitParams) -> _Laid:
    traces = distinct(every)
    if not traces:
        raise NotEnoughSamples(needed=params.min_rows, got=0)
    line = road.line if road.line is not None else derive_line(traces)
    end_m, shortest_m = length_m(line), params.segmentation.min_length_m
    if end_m < shortest_m:
        raise RoadTooShort(needed_m=shortest_m, got_m=end_m)
    cells = all_cells(traces)
    laid = [lay_on_road(line, trace, cells, f"pass-{i}") for i, trace in enumerate(traces)]
    passes = [one for one in laid if one is not None]
    on_road = [trace for trace, one in zip(traces, laid, strict=True) if one is not None]
    rows = sum(len(one.chainage_m) for one in passes)
    if rows < params.min_rows:
        raise NotEnoughSamples(needed=params.min_rows, got=rows)
    readings = np.sum([(~np.isnan(one.rsrp_dbm)).sum(axis=0) for one in passes], axis=0)
    often = readings >= params.min_readings
    if not often.any():
        raise NoCells(heard=len(cells), needed_samples=params.min_readings)
    kept = [one.of_cells(often) for one in passes]
    mapped = tuple(cell for cell, keep in zip(cells, often, strict=True) if keep)
    return _Laid(line, mapped, kept, on_road)


def _fitting(laid: _Laid, params: FitParams) -> Fitting:
    return Fitting(length_m(laid.line), params.grid_step_m, carriers.numbers(laid.cells))


@dataclass(frozen=True, slots=True, eq=False)
class _Fitted:
    """
    The passes without lag and level, and what was fitted to them.

    Attributes:
        shared: What the cells of a sample have in common about the curves.
        likeliest: Strength of the penalty by restricted likelihood.
    """

    passes: list[RoadPass]
    curves: FittedCurves
    surface: Surface
    shared: Shared
    likeliest: float

    @property
    def apart(self) -> bool:
        """Whether readings are taken to err independently about the curves."""
        return self.shared.may_be_chance(CHANCES_SDS)


def _fit(driven: list[RoadPass], work: Fitting) -> _Fitted:
    curves = work.curves(driven)
    passes = work.registration(driven, curves.strength).correct(driven)
    if any(now is not before for now, before in zip(passes, driven, strict=True)):
        curves = work.curves(passes)
    shared, likeliest = shared_about(passes, curves, work.step_m), curves.strength
    apart = shared.may_be_chance(CHANCES_SDS)
    strength = work.strength(passes, likeliest, apart=apart)
    if strength != likeliest:
        curves = work.curves(passes, strength)
    return _Fitted(passes, curves, work.surface(passes, curves, apart=apart), shared, likeliest)


def _reference(cells: tuple[str, ...], traces: Sequence[Trace], surface: Surface) -> int:
    """The surveys' reference cell if they name one that is mapped, else the one heard most."""
    named = [trace.reference_cell for trace in traces if trace.reference_cell in cells]
    if named:
        return cells.index(max(sorted(set(named)), key=named.count))
    return int(np.argmax(surface.usually_heard.mean(axis=0)))


def _assemble(
    road: Road,
    laid: _Laid,
    work: Fitting,
    fit: _Fitted,
    reference: int,
    params: FitParams,
) -> RoadModel:
    surface, curves = fit.surface, fit.curves
    edges_m = cut_road(surface.mean_dbm, work.step_m, work.end_m, params.segmentation)
    salience, parts = select_salient(
        surface.mean_dbm, surface.spread_db, surface.usually_heard, work.step_m, edges_m, reference
    )
    fitted = FittedRoad(laid.cells, curves, fit.passes, surface.mean_dbm, work.step_m, reference)

    def refit(driven: Sequence[RoadPass]) -> Surface:
        # Held-out windows stay as a client would send them, and the others are registered without
        # them: else the map would take its own corrections for accuracy.
        passes = work.registration(driven, fit.likeliest).correct(driven)
        strength = work.strength(passes, fit.likeliest, apart=fit.apart)
        return work.surface(passes, work.curves(passes, strength), apart=fit.apart)

    held_out = held_out_evidence(
        laid.passes, laid.cells, surface, refit, work.step_m, shared=fit.shared
    )
    return RoadModel(
        road_id=road.road_id,
        line=laid.line,
        length_m=work.end_m,
        cells=laid.cells,
        step_m=work.step_m,
        mean_dbm=surface.mean_dbm,
        spread_db=surface.spread_db,
        heard=surface.heard,
        features=feature_matrix(surface.mean_dbm, work.grid_m, reference),
        salience=salience,
        segments=describe_segments(laid.line, edges_m, fitted, parts),
        pass_count=len(laid.passes),
        sample_count=sum(len(one.chainage_m) for one in fit.passes),
        evidence=held_out.windows,
        unseen=held_out.unseen,
        heard_on=_heard_on(laid),
    )


def _heard_on(laid: _Laid) -> dict[str, Bool[np.ndarray, " cells"]]:
    """Cells that each day's passes heard on the road."""
    days = [
        trace.recorded_at.date().isoformat() if trace.recorded_at else "" for trace in laid.traces
    ]
    heard = [(one.heard > 0.0).any(axis=0) for one in laid.passes]
    return {
        day: np.any([one for one, its in zip(heard, days, strict=True) if its == day], axis=0)
        for day in sorted(set(days))
    }
