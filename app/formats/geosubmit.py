"""Reports of Ichnaea's geosubmit, version 2: a position with the cells that were heard there."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any, BinaryIO

from app.errors import Fault
from app.formats.account import NO_POSITION, NOT_LTE_OR_NR, Account, WrongFile
from app.formats.cells import global_id, short_key
from app.formats.options import Options
from app.formats.rows import UNKNOWN, DriveLabel, Fix, Labels, RowList, Rows
from app.formats.values import epoch_s

RADIOS = {"lte": False, "nr": True}
MOST_FAULTS = 20  # spelled out in one answer
MOST_AGE_MS = 10_000.0  # an older reading belongs to another place
MOST_FIX_AGE_MS = 3_600_000.0  # of a position; what says more is no age


def read(source: BinaryIO, options: Options, account: Account, labels: Labels) -> Iterator[Rows]:
    """
    The cells of all reports as one block, numbered by report from 1.

    Raises:
        WrongFile: It is no JSON, or not this one; pointers lead to the place.
    """
    yield rows_of(load(source.read()), options, account, labels)


def load(raw: bytes) -> list[Any]:
    """
    The list of reports.

    Raises:
        WrongFile: There is none.
    """
    try:
        document = json.loads(raw)
    except (ValueError, RecursionError) as error:
        raise WrongFile(f"no JSON: {error}") from error
    items = document.get("items") if isinstance(document, dict) else None
    if not isinstance(items, list):
        raise WrongFile("a list of reports is missing", "/items")
    wrong = [i for i, item in enumerate(items) if not _is_report(item)]
    if wrong:
        malformed = WrongFile(f"{len(wrong)} reports are malformed")
        told = "no report of a position and cells"
        malformed.faults = [Fault(f"/items/{i}", told) for i in wrong[:MOST_FAULTS]]
        raise malformed
    return items


def _is_report(item: object) -> bool:
    """Objects where objects belong, lists where lists do; numbers are looked at one by one."""
    if not isinstance(item, dict):
        return False
    cells = item.get("cellTowers")
    return isinstance(item.get("position") or {}, dict) and (
        cells is None or (isinstance(cells, list) and all(isinstance(one, dict) for one in cells))
    )


def rows_of(items: list[Any], options: Options, account: Account, labels: Labels) -> Rows:
    """One row a cell of a report."""
    found = RowList()
    drive = labels.drive(DriveLabel(options.device))
    for line, item in enumerate(items, start=1):
        cells = item.get("cellTowers") or []
        account.rows += len(cells)
        if not item.get("position"):
            account.drop(NO_POSITION, [line] * len(cells))
            continue
        fix = _fix(line, drive, item)
        for cell in cells:
            _add(found, fix, cell, account, labels)
    return found.rows()


def _fix(line: int, drive: int, item: Mapping[str, Any]) -> Fix:
    """The moment at which the position was measured."""
    position = item["position"]
    age_ms = _number(position, "age")
    age_s = age_ms / 1000.0 if abs(age_ms) < MOST_FIX_AGE_MS else 0.0
    return Fix(
        line=line,
        drive=drive,
        time_s=epoch_s(_number(item, "timestamp")) - age_s,
        lon=_number(position, "longitude"),
        lat=_number(position, "latitude"),
        speed_mps=_number(position, "speed"),
        accuracy_m=_number(position, "accuracy"),
    )


def _add(
    found: RowList, fix: Fix, cell: Mapping[str, Any], account: Account, labels: Labels
) -> None:
    nr = RADIOS.get(str(cell.get("radioType")).lower())
    if nr is None:
        account.drop(NOT_LTE_OR_NR, [fix.line])
        return
    if abs(_number(cell, "age")) > MOST_AGE_MS:
        account.drop("cell heard too long before or after", [fix.line])
        return
    pci, arfcn = _whole(cell, "primaryScramblingCode"), _whole(cell, "arfcn")
    mcc, mnc = (_code(cell, f"mobile{name}Code") for name in ("Country", "Network"))
    gid = global_id(mcc, mnc, _whole(cell, "cellId"))
    key = short_key(arfcn, pci) or gid
    told = cell.get("serving")
    serving = int(told) if isinstance(told, int) and told in {0, 1} else UNKNOWN
    found.add(fix, labels.cell(key, gid), _number(cell, "signalStrength"), serving=serving, nr=nr)


def _number(told: Mapping[str, Any], name: str) -> float:
    """The number; NaN when absent, infinity when it is none."""
    value = told.get(name)
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.inf
    try:
        return float(value)
    except OverflowError:  # JSON knows whole numbers of any length
        return math.inf


def _whole(told: Mapping[str, Any], name: str) -> int | None:
    value = _number(told, name)
    return int(value) if math.isfinite(value) and value.is_integer() else None


def _code(told: Mapping[str, Any], name: str) -> str | None:
    """A code as text where the client sends one (its zeros count), else its number."""
    text = told.get(f"{name}Str")
    if isinstance(text, str) and text.isdigit():
        return text
    number = _whole(told, name)
    return None if number is None else str(number)
