"""From a posted survey to a trace, JSON or CSV: validated here and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

import numpy as np
from pydantic import TypeAdapter, ValidationError

from app.api.checks import (
    check_cells,
    check_jumps,
    check_length,
    check_rising,
    check_rows,
    check_rsrp,
    check_within,
)
from app.api.faults import Faults, invalid_input, pointer_of
from app.api.schemas.surveys import SurveyRequest
from app.domain import Trace

MIN_SAMPLES = 2  # one sample spans no stretch of road

_adapter = TypeAdapter(SurveyRequest)


@dataclass(frozen=True, slots=True)
class Described:
    """What may be said of a survey beside its samples: in the query, or in a JSON body."""

    road_id: str | None = None
    device: str | None = None
    recorded_at: datetime | None = None
    reference_cell: str | None = None
    radio: str | None = None


def trace_of_json(raw: bytes, described: Described) -> Trace:
    """
    The trace in a columnar JSON body.

    Raises:
        InvalidInput: With JSON pointers into the body.
    """
    try:
        survey = _adapter.validate_json(raw)
    except ValidationError as error:
        raise invalid_input(error) from None
    return trace_of_survey(survey, described)


def trace_of_survey(survey: SurveyRequest, described: Described) -> Trace:
    """
    The trace of a survey whose shape is right already; its times count from its first sample.

    Raises:
        InvalidInput: Values are wrong, or the query contradicts the body.
    """
    faults = Faults()
    survey = _described(survey, described, faults)
    samples = len(survey.time_s)
    for name in ("lon", "lat", "rsrp_dbm"):
        check_length(f"/{name}", len(getattr(survey, name)), samples, faults)
    if samples < MIN_SAMPLES:
        faults.add("/time_s", f"{samples} samples; a survey needs {MIN_SAMPLES}")
    check_cells(survey.cells, faults)
    if survey.reference_cell is not None and survey.reference_cell not in survey.cells:
        faults.add("/reference_cell", f"{survey.reference_cell!r} is not in /cells")
    for cell in survey.global_ids or {}:
        if cell not in survey.cells:
            faults.add(pointer_of(("global_ids", cell)), f"{cell!r} is not in /cells")
    whole = check_rows(survey.rsrp_dbm, len(survey.cells), faults)
    if not whole or not samples or not survey.cells:
        faults.raise_if_any()  # there is no matrix to look at further
    return _checked_trace(survey, faults)


def _described(survey: SurveyRequest, described: Described, faults: Faults) -> SurveyRequest:
    """The survey with what the query says of it."""
    told: dict[str, object] = {}
    for name in Described.__slots__:
        in_query, in_body = getattr(described, name), getattr(survey, name)
        if in_query is not None and in_body not in {None, in_query}:
            faults.add(f"/{name}", f"{in_body!r} here, {in_query!r} in the query")
        if in_query is not None:
            told[name] = in_query
    return survey.model_copy(update=told)


def _checked_trace(survey: SurveyRequest, faults: Faults) -> Trace:
    time_s, lon, lat = (np.array(column) for column in (survey.time_s, survey.lon, survey.lat))
    rsrp_dbm = np.array(survey.rsrp_dbm, dtype=np.float64)  # None becomes NaN
    check_rising("/time_s", time_s, "s", faults)
    check_within("/lon", lon, (-180.0, 180.0), "degrees", faults)
    check_within("/lat", lat, (-90.0, 90.0), "degrees", faults)
    if lon.size == lat.size and not faults.count:
        check_jumps(lon, lat, faults)
    check_rsrp(rsrp_dbm, survey.radio, faults)
    if np.isnan(rsrp_dbm).all():
        faults.add("/rsrp_dbm", "no cell is heard in any sample")
    faults.raise_if_any()
    return Trace(
        cells=tuple(survey.cells),
        time_s=time_s - time_s[0],
        lon=lon,
        lat=lat,
        rsrp_dbm=rsrp_dbm.astype(np.float32),
        road_id=survey.road_id,
        device=survey.device,
        recorded_at=survey.recorded_at,
        reference_cell=survey.reference_cell,
        global_ids=survey.global_ids or {},
    )
