"""Network Survey's records of LTE and NR cells: CSV files, and JSON messages as it streams them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, BinaryIO

from app.formats.account import NOT_A_RECORD, NOT_LTE_OR_NR, Account, BrokenFile
from app.formats.cells import global_id, short_key, whole
from app.formats.json_stream import each_document
from app.formats.options import Options
from app.formats.rows import UNKNOWN, DriveLabel, Fix, Labels, RowList, Rows
from app.formats.table import Layout, read_blocks
from app.formats.values import level_dbm, moment_s, number

NEEDED = ("devicetime", "latitude", "longitude", "pci")
LTE, NR = ("earfcn", "rsrp"), ("narfcn", "ssrsrp")
WANTED = (*NEEDED, *LTE, *NR, "mcc", "mnc", "eci", "nci", "accuracy", "speed", "servingcell",
          "missionid", "groupnumber", "deviceserialnumber", "devicename")  # fmt: skip
RECORDS = {"LteRecord": False, "NrRecord": True}
BLOCK_ROWS = 5_000
MOST_GROUP_S = 2.0  # one scan's records are written within moments

Record = Mapping[str, str | None]


def is_table(names: tuple[str, ...]) -> bool:
    """Whether a header is that of an LTE or an NR file."""
    return set(NEEDED) <= set(names) and (set(LTE) <= set(names) or set(NR) <= set(names))


def read_table(source: BinaryIO, layout: Layout, options: Options, account: Account,
               labels: Labels) -> Iterator[Rows]:  # fmt: skip
    """Blocks of a CSV file."""
    knows_nr, knows_lte = set(NR) <= set(layout.names), set(LTE) <= set(layout.names)
    scans = _Scans()
    for block in read_blocks(source, layout, WANTED, account):
        found = RowList()
        names = list(block.columns)
        values = zip(*(block.columns[name].texts() for name in names), strict=True)
        for line, row in zip(block.lines.tolist(), values, strict=True):
            told = dict(zip(names, row, strict=True))
            # A table of both has one or the other in a row.
            nr = knows_nr and not (knows_lte and not told["ssrsrp"])
            _add(found, line, told, options, labels, scans, nr=nr)
        yield found.rows()


def read_messages(
    source: BinaryIO, options: Options, account: Account, labels: Labels
) -> Iterator[Rows]:
    """
    Blocks of JSON messages: one a line, an array of them, or one after another.

    Raises:
        BrokenFile: It is no JSON from some place on.
    """
    found, scans = RowList(), _Scans()
    try:
        for line, message in each_document(source):
            account.rows += 1
            _add_message(found, line, message, options, account, labels, scans)
            if len(found) >= BLOCK_ROWS:
                yield found.rows()
                found = RowList()
    except BrokenFile:
        yield found.rows()  # what came before is sound
        raise
    yield found.rows()


def _add_message(
    found: RowList,
    line: int,
    message: Any,
    options: Options,
    account: Account,
    labels: Labels,
    scans: _Scans,
) -> None:
    kind = message.get("messageType") if isinstance(message, dict) else None
    record = message.get("data") if isinstance(message, dict) else None
    if not isinstance(kind, str) or not isinstance(record, dict):
        account.drop(NOT_A_RECORD, [line])
    elif kind not in RECORDS:
        account.drop(NOT_LTE_OR_NR, [line])
    else:
        _add(found, line, _texts(record), options, labels, scans, nr=RECORDS[kind])


class _Scans:
    """
    The fix that the records of one scan share.

    Each record has the moment at which it was written, milliseconds after the one before; the group
    number says which of them were measured together.
    """

    def __init__(self) -> None:
        self._group: tuple[int, str | None, str] | None = None
        self._fix: Fix | None = None

    def shared(self, fix: Fix, told: Record) -> Fix:
        """The fix of the scan's first record."""
        number_of = told.get("groupnumber")
        if not number_of:
            return fix
        group = (fix.drive, told.get("missionid"), number_of)
        first = self._fix
        if group != self._group or first is None or abs(fix.time_s - first.time_s) > MOST_GROUP_S:
            self._group, self._fix = group, fix
            return fix
        return replace(first, line=fix.line)


def _add(
    found: RowList,
    line: int,
    told: Record,
    options: Options,
    labels: Labels,
    scans: _Scans,
    *,
    nr: bool,
) -> None:
    device = options.device or told.get("deviceserialnumber") or told.get("devicename") or None
    fix = Fix(
        line=line,
        drive=labels.drive(DriveLabel(device)),
        time_s=moment_s(told.get("devicetime") or "", options.zone),
        lon=number(told.get("longitude") or ""),
        lat=number(told.get("latitude") or ""),
        speed_mps=_not_negative(told.get("speed")),
        accuracy_m=_not_negative(told.get("accuracy")),
    )
    earfcn, level, identity = ("narfcn", "ssrsrp", "nci") if nr else ("earfcn", "rsrp", "eci")
    gid = global_id(told.get("mcc"), told.get("mnc"), whole(told.get(identity)))
    key = short_key(whole(told.get(earfcn)), whole(told.get("pci"))) or gid
    serving = {"true": 1, "1": 1, "false": 0, "0": 0}.get(
        (told.get("servingcell") or "").lower(), UNKNOWN
    )
    rsrp_dbm = level_dbm(told.get(level) or "")
    found.add(scans.shared(fix, told), labels.cell(key, gid), rsrp_dbm, serving=serving, nr=nr)


def _texts(record: Mapping[str, Any]) -> dict[str, str]:
    """A record's values as a table has them, so that both are read alike."""
    return {
        name.lower(): value if isinstance(value, str) else json.dumps(value)
        for name, value in record.items()
        if value is not None
    }


def _not_negative(text: str | None) -> float:
    value = number(text or "")
    return value if math.isfinite(value) and value >= 0.0 else math.nan
