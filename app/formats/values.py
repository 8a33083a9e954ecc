"""Texts into numbers with their units, and into moments with their zone."""

from __future__ import annotations

import math
import re
from datetime import UTC, datetime, tzinfo

from app.formats.cells import ABSENT

UNREADABLE = math.inf  # a text that is no number; NaN is a number that is not there
EPOCH_LEAST_S = 1e8  # smaller times count from a drive's start, larger ones from 1970
EPOCH_LEAST_MS = 1e11  # larger times are milliseconds: as seconds it would be the year 5138
EPOCH_LEAST_US, EPOCH_LEAST_NS = 1e14, 1e17  # and likewise on
LATEST_S = 4.1e9  # the year 2100: what says more, or as much before 1970, is no time
MPS_PER_KMH = 1.0 / 3.6

_MEASURE = re.compile(r"([-+]?[0-9]*[.,]?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*([^\s0-9]*)")
_TIME_OF_DAY = r"[_ T]+(\d{1,2})[.:](\d{2})[.:](\d{2})(?:[.,](\d+))?"
_LOCAL = re.compile(r"(\d{4})[.\-/](\d{1,2})[.\-/](\d{1,2})" + _TIME_OF_DAY)
# With dots the day comes first; with slashes nobody knows, and such times are refused.
_DAY_FIRST = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})" + _TIME_OF_DAY)
DBM = {"dbm": 1.0, "": 1.0}


def number(text: str) -> float:
    """
    The number, with a point or a comma; NaN when a tool writes nothing, infinity when it is none.

    No quantity of a drive test needs a comma for its thousands.
    """
    try:
        value = float(text)
    except ValueError:
        if text.count(",") == 1 and "." not in text:
            return number(text.replace(",", "."))
        return math.nan if text.strip().lower() in ABSENT else UNREADABLE
    return UNREADABLE if "_" in text else value  # Python reads 1_000, no table means it


def level_dbm(text: str) -> float:
    """A level, with its unit or without."""
    value = number(text)
    if value != UNREADABLE:
        return value
    told = measure(text, DBM)
    return UNREADABLE if told is None else told


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
    factor = units.get(found[2], units.get(found[2].lower()))
    return None if factor is None else float(found[1].replace(",", ".")) * factor


def local_time_s(text: str, zone: tzinfo) -> float:
    """Seconds since 1970 of a local date and time; NaN when absent, infinity when it is none."""
    if text.strip().lower() in ABSENT:
        return math.nan
    found = _LOCAL.fullmatch(text.strip())
    reverse = None if found else _DAY_FIRST.fullmatch(text.strip())
    found = found or reverse
    if found is None:
        return UNREADABLE
    year, month, day, hour, minute, second = map(int, found.groups()[:6])
    if reverse:
        year, day = day, year
    fraction_s = float(f"0.{found[7]}") if found[7] else 0.0
    try:
        moment = datetime(year, month, day, hour, minute, second, tzinfo=zone)
    except ValueError:
        return UNREADABLE
    return moment.timestamp() + fraction_s


def moment_s(text: str, zone: tzinfo = UTC) -> float:
    """
    Seconds since 1970 of a moment: Unix seconds (or thousandths, or finer), ISO 8601, or local.

    A time without a zone is in ``zone``.
    """
    value = number(text)
    if not math.isinf(value):
        return epoch_s(value)
    told = text.strip()
    for word in ("UTC", "GMT"):
        told = f"{told[:-3].strip()}+00:00" if told.endswith(word) else told
    try:
        moment = datetime.fromisoformat(told)
    except ValueError:
        return local_time_s(text, zone)
    return (moment if moment.tzinfo else moment.replace(tzinfo=zone)).timestamp()


def epoch_s(value: float) -> float:
    """Seconds of a Unix time in whatever unit its size tells; infinity when it is no time."""
    for least, per_s in ((EPOCH_LEAST_NS, 1e9), (EPOCH_LEAST_US, 1e6), (EPOCH_LEAST_MS, 1e3)):
        if value >= least:
            value /= per_s
            break
    return UNREADABLE if abs(value) > LATEST_S else value
