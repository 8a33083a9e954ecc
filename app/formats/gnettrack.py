"""G-NetTrack Pro's text log: the serving cell a row, neighbours in further columns."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping
from typing import BinaryIO

from app.formats.account import NO_CELL, NOT_LTE_OR_NR, Account
from app.formats.cells import (
    ABSENT,
    global_id,
    short_key,
    split_operator,
    technology,
    whole,
)
from app.formats.options import Options
from app.formats.rows import DriveLabel, Fix, Labels, RowList, Rows
from app.formats.table import Block, Layout, read_blocks
from app.formats.values import MPS_PER_KMH, UNREADABLE, level_dbm, moment_s, number

TIMES = ("timestamp", "times", "time")
LEVELS = ("level", "rxlev")
SERVING = ("longitude", "latitude", "operator", "node", "cellid", "networktech", "arfcn", "psc",
           "speed", "accuracy", "imei", *TIMES, *LEVELS)  # fmt: skip
NEIGHBOUR = ("ntech", "ncell", "ncellid", "narfcn", "nrxlev")
MOST_NEIGHBOURS = 32
ECI_PER_ENB = 256  # an ECI is the eNB's id and eight bits of cell

Record = Mapping[str, str | None]


def is_log(names: tuple[str, ...]) -> bool:
    """Whether a header is that of a text log, of any version and choice of columns."""
    return (
        {"longitude", "latitude", "networktech"} <= set(names)
        and any(name in names for name in TIMES)
        and any(name in names for name in LEVELS)
    )


def read(source: BinaryIO, layout: Layout, options: Options, account: Account,
         labels: Labels) -> Iterator[Rows]:  # fmt: skip
    """Blocks of a log; its times are local and without a zone."""
    account.note(f"times without a zone are taken as {options.zone}")
    neighbours = [k for k in range(1, MOST_NEIGHBOURS + 1) if f"nrxlev{k}" in layout.names]
    wanted = [*SERVING, *(f"{name}{k}" for k in neighbours for name in NEIGHBOUR)]
    for block in read_blocks(source, layout, wanted, account):
        yield _rows(block, neighbours, options, account, labels)


def _rows(
    block: Block, neighbours: list[int], options: Options, account: Account, labels: Labels
) -> Rows:
    found = RowList()
    names = list(block.columns)
    time = next(name for name in TIMES if name in block.columns)
    times_s = block.columns[time].numbers(lambda text: moment_s(text, options.zone))
    columns = zip(*(block.columns[name].texts() for name in names), strict=True)
    other: list[int] = []
    nameless: list[int] = []
    for line, time_s, values in zip(block.lines.tolist(), times_s.tolist(), columns, strict=True):
        told: Record = dict(zip(names, values, strict=True))
        fix = fix_of(line, time_s, told, options, labels)
        nr = technology(told.get("networktech"))
        if nr is None:
            other.append(line)
        else:
            add_serving(found, fix, told, labels, nr=nr)
        named = [
            _add_neighbour(found, fix, neighbour_of(told, k), labels, serving_nr=nr)
            for k in neighbours
        ]
        nameless += [line] * named.count(False)
    account.drop(NOT_LTE_OR_NR, other)
    account.drop(NO_CELL, nameless)
    return found.rows()


def fix_of(line: int, time_s: float, told: Record, options: Options, labels: Labels) -> Fix:
    """When, where and by which phone a row was written; an IMEI is kept as a digest only."""
    speed_mps = number(told.get("speed") or "") * MPS_PER_KMH
    accuracy_m = number(told.get("accuracy") or "")
    return Fix(
        line=line,
        drive=labels.drive(DriveLabel(options.device or digest_of(told.get("imei")))),
        time_s=time_s,
        lon=number(told.get("longitude") or ""),
        lat=number(told.get("latitude") or ""),
        speed_mps=speed_mps if 0.0 <= speed_mps < UNREADABLE else math.nan,
        accuracy_m=accuracy_m if 0.0 <= accuracy_m < UNREADABLE else math.nan,
    )


def digest_of(imei: str | None) -> str | None:
    """A name that tells phones apart and tells nobody the IMEI."""
    if imei is None or imei.strip().lower() in ABSENT:
        return None
    return "phone-" + hashlib.sha256(imei.strip().encode()).hexdigest()[:12]


def add_serving(found: RowList, fix: Fix, told: Record, labels: Labels, *, nr: bool) -> None:
    """The serving cell; what the tool calls PSC is the PCI on LTE and NR."""
    mcc, mnc = split_operator(told.get("operator"))
    node, cell = whole(told.get("node")), whole(told.get("cellid"))
    identity = None
    if not nr and node is not None and cell is not None and 0 <= cell < ECI_PER_ENB:
        identity = node * ECI_PER_ENB + cell  # NR splits its identity by an unknown length
    gid = global_id(mcc, mnc, identity)
    key = short_key(whole(told.get("arfcn")), whole(told.get("psc"))) or gid
    level = next((told[name] for name in LEVELS if told.get(name)), None)
    found.add(fix, labels.cell(key, gid), level_dbm(level or ""), serving=1, nr=nr)


def neighbour_of(told: Record, k: int) -> Record:
    """The columns of neighbour ``k`` without their number."""
    return {name: told.get(f"{name}{k}") for name in NEIGHBOUR}


def _add_neighbour(
    found: RowList, fix: Fix, told: Record, labels: Labels, *, serving_nr: bool | None
) -> bool:
    """
    A neighbour, when it was measured on LTE or NR; False when it was and has no name.

    Without a technology of its own it has the serving cell's.
    """
    level = level_dbm(told["nrxlev"] or "")
    own = told["ntech"]
    nr = technology(own) if own and own.strip().lower() not in ABSENT else serving_nr
    if math.isnan(level) or nr is None:
        return True
    key = short_key(whole(told["narfcn"]), whole(told["ncell"]))
    if key is not None:
        found.add(fix, labels.cell(key), level, serving=0, nr=nr)
    return key is not None
