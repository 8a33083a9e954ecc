"""Surveys as tidy CSV: a row a reading, rows of one time and place are one sample."""

from __future__ import annotations

import csv
import io
import math
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from operator import itemgetter

from pydantic import ValidationError

from app.api.faults import Faults, invalid_input
from app.api.schemas.surveys import SurveyRequest
from app.api.surveys import Described, trace_of_survey
from app.domain import Trace
from app.errors import Fault, InvalidInput

REQUIRED = ("time_s", "lon", "lat", "cell_id", "rsrp_dbm")
OPTIONAL = ("serving",)  # read by other tools; the method treats all cells alike


@dataclass(slots=True)
class _Samples:
    """
    Columns as they grow, with the line that each sample and reading came from.

    ``readings`` holds for each sample the place of each cell's reading in the two flat arrays.
    ``last`` is the sample of the row before with its time and place as they were written: most rows
    repeat these.
    """

    time_s: list[float] = field(default_factory=list)
    lon: list[float] = field(default_factory=list)
    lat: list[float] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    readings: list[dict[int, int]] = field(default_factory=list)
    rsrp_dbm: array[float] = field(default_factory=lambda: array("d"))
    reading_lines: array[int] = field(default_factory=lambda: array("q"))
    cells: dict[str, int] = field(default_factory=dict)
    at: dict[tuple[float, ...], int] = field(default_factory=dict)
    last: tuple[tuple[str, ...], int] = ((), -1)


def trace_of_csv(raw: bytes, described: Described) -> Trace:
    """
    The trace in a tidy CSV body; columns are found by name.

    Raises:
        InvalidInput: With pointers ``/lines/<line>/<column>``, lines counted from 1, the header's.
    """
    faults = Faults()
    samples = _Samples()
    for line, row in _rows(raw, faults):
        _add(samples, line, row, faults)
    faults.raise_if_any()
    try:
        survey = SurveyRequest.model_validate(_columnar(samples))
        return trace_of_survey(survey, described)
    except ValidationError as error:
        raise _by_line(invalid_input(error), samples) from None
    except InvalidInput as error:
        raise _by_line(error, samples) from None


def _rows(raw: bytes, faults: Faults) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Each row with its line, its values in the order of `REQUIRED`."""
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        faults.add("", f"not UTF-8 at byte {error.start}")
        return
    reader = csv.reader(io.StringIO(text, newline=""))
    try:
        header = [name.strip() for name in next(reader, [])]
        if not _header_is_right(header, faults):
            return
        in_order = itemgetter(*map(header.index, REQUIRED))
        for values in reader:
            if len(values) == len(header):
                yield reader.line_num, in_order(values)
            elif values:
                detail = f"{len(values)} values for {len(header)} columns"
                faults.add(f"/lines/{reader.line_num}", detail)
    except csv.Error as error:
        faults.add(f"/lines/{reader.line_num}", f"no CSV: {error}")


def _header_is_right(header: list[str], faults: Faults) -> bool:
    for name in REQUIRED:
        if name not in header:
            faults.add(f"/lines/1/{name}", f"the column {name!r} is missing")
    for place, name in enumerate(header):
        if name in header[:place]:
            faults.add(f"/lines/1/{name}", f"the column {name!r} stands twice")
        elif name not in REQUIRED + OPTIONAL:
            faults.add(f"/lines/1/{name}", f"unknown column {name!r}")
    return not faults.count


def _add(samples: _Samples, line: int, row: tuple[str, ...], faults: Faults) -> None:
    """One row into the columns: a new sample, or another cell of one that is there."""
    written = row[:3]
    if written != samples.last[0]:
        sample = _sample_at(samples, line, written, faults)
        if sample is None:
            return
        samples.last = (written, sample)
    if row[4].strip():
        _add_reading(samples, samples.last[1], line, row, faults)


def _sample_at(
    samples: _Samples, line: int, written: tuple[str, ...], faults: Faults
) -> int | None:
    """The sample of a time and place, a new one when they are; None when they are no numbers."""
    place = tuple(
        _number(text, f"/lines/{line}/{name}", faults)
        for text, name in zip(written, REQUIRED, strict=False)
    )
    if any(map(math.isnan, place)):
        return None
    sample = samples.at.setdefault(place, len(samples.time_s))
    if sample == len(samples.time_s):
        for column, number in zip((samples.time_s, samples.lon, samples.lat), place, strict=True):
            column.append(number)
        samples.readings.append({})
        samples.lines.append(line)
    return sample


def _add_reading(
    samples: _Samples, sample: int, line: int, row: tuple[str, ...], faults: Faults
) -> None:
    cell_id = row[3].strip()
    rsrp_dbm = _number(row[4], f"/lines/{line}/rsrp_dbm", faults)
    cell = samples.cells.setdefault(cell_id, len(samples.cells))
    here = samples.readings[sample]
    if cell in here:
        earlier = samples.reading_lines[here[cell]]
        faults.add(f"/lines/{line}/cell_id", f"{cell_id!r} is in this sample since line {earlier}")
        return
    here[cell] = len(samples.rsrp_dbm)
    samples.rsrp_dbm.append(rsrp_dbm)
    samples.reading_lines.append(line)


def _number(text: str, pointer: str, faults: Faults) -> float:
    """The number, or NaN with a fault noted."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if math.isfinite(number) and "_" not in text:  # Python reads 1_000, a CSV does not mean it
        return number
    faults.add(pointer, f"{text[:40]!r} is no finite number")
    return math.nan


def _columnar(samples: _Samples) -> dict[str, object]:
    cells = range(len(samples.cells))
    value = samples.rsrp_dbm
    return {
        "cells": list(samples.cells),
        "time_s": samples.time_s,
        "lon": samples.lon,
        "lat": samples.lat,
        "rsrp_dbm": [
            [value[here[cell]] if cell in here else None for cell in cells]
            for here in samples.readings
        ],
    }


def _by_line(error: InvalidInput, samples: _Samples) -> InvalidInput:
    """The same faults, pointing at the lines that the samples came from."""
    return InvalidInput([Fault(_line_pointer(f.pointer, samples), f.detail) for f in error.faults])


def _line_pointer(pointer: str, samples: _Samples) -> str:
    name, *steps = pointer.removeprefix("/").split("/")
    numbers = [int(step) for step in steps if step.isdigit()]
    if name == "rsrp_dbm" and len(numbers) == 2:
        place = samples.readings[numbers[0]][numbers[1]]
        return f"/lines/{samples.reading_lines[place]}/rsrp_dbm"
    if name == "cells" and numbers:
        first = next(here[numbers[0]] for here in samples.readings if numbers[0] in here)
        return f"/lines/{samples.reading_lines[first]}/cell_id"
    if name in {"time_s", "lon", "lat"} and numbers:
        return f"/lines/{samples.lines[numbers[0]]}/{name}"
    return pointer
