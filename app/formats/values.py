"""Texts into numbers with their units, and into moments with their zone."""

from __future__ import annotations

import math
import re
from datetime import UTC, datetime, tzinfo

from app.formats.cells import ABSENT

UNREADABLE = math.inf  # a text that is no number; NaN is a number that is not there
EPOCH_LEAST_S = 1e8  # smaller times count from a drive's start, larger ones from 1970
EPOCH_LEAST_MS = 1e11  # larger times are milliseconds: as seconds it would be the year 5138
MPS_PER_KMH = 1.0 / 3.6

_MEASURE = re.compile(r"([-+]?[0-9]*[.,]?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*([^\s0-9]*)")
_LOCAL = re.compile(
    r"(\d{4})[.\-/](\d{1,2})[.\-/](\d{1,2})[_ T](\d{1,2})[.:](\d{2})[.:](\d{2})(?:[.,](\d+))?"
)


def number(text: str) -> float:
    """The number; NaN when a tool writes nothing, infinity when it is no number."""
    try:
        value = float(text)
    except ValueError:
        return math.nan if text.strip().lower() in ABSENT else UNREADABLE
    return UNREADABLE if "_" in text else value  # Python reads 1_000, no table means it


def decimal(text: str) -> float:
    """The same where a comma may be the decimal point."""
    return number(text.replace(",", ".")) if text.count(",") == 1 else number(text)


def measure(text: str, units: dict[str, float]) -> float | None:
    """
    A number with its unit as text (``-72 dBm``); None when the unit is not among ``units``.

    ``units`` maps a unit to its factor; the empty unit is a bare number.
    """
    if text.strip().lower() in ABSENT:
        return math.nan
    found = _MEASURE.fullmatch(text.strip())
    if found is None:
        return UNREADABLE
    factor = units.get(found[2])
    return None if factor is None else float(found[1].replace(",", ".")) * factor


def local_time_s(text: str, zone: tzinfo) -> float:
    """Seconds since 1970 of a local date and time; NaN when absent, infinity when it is none."""
    if text.strip().lower() in ABSENT:
        return math.nan
    found = _LOCAL.fullmatch(text.strip())
    if found is None:
        return UNREADABLE
    year, month, day, hour, minute, second = map(int, found.groups()[:6])
    fraction_s = float(f"0.{found[7]}") if found[7] else 0.0
    try:
        moment = datetime(year, month, day, hour, minute, second, tzinfo=zone)
    except ValueError:
        return UNREADABLE
    return moment.timestamp() + fraction_s


def moment_s(text: str, zone: tzinfo = UTC) -> float:
    """
    Seconds since 1970 of a moment: Unix seconds or milliseconds, ISO 8601, or a local time.

    A time without a zone is in ``zone``.
    """
    value = number(text)
    if math.isfinite(value):
        return value / 1000.0 if value >= EPOCH_LEAST_MS else value
    if math.isnan(value):
        return value
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        return local_time_s(text, zone)
    return (moment if moment.tzinfo else moment.replace(tzinfo=zone)).timestamp()
