"""OpenCelliD measurements CSV, as Network Cell Info, AIMSICD and Tower Collector write it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np

from app.formats.account import NOT_LTE_OR_NR, Account
from app.formats.cells import ABSENT, global_id, short_key, technology, whole
from app.formats.options import Options
from app.formats.rows import UNKNOWN, DriveLabel, Labels, Rows
from app.formats.table import Block, Layout, read_blocks
from app.formats.values import level_dbm, moment_s, number

NEEDED = ("mcc", "mnc", "lat", "lon", "signal", "measured_at")
IDENTITIES = ("cellid", "cell_id")
AGGREGATE = frozenset({"range", "samples", "changeable"})  # of a list of cells
WANTED = (*NEEDED, *IDENTITIES, "lac", "tac", "pci", "psc", "rating", "speed", "act", "radio",
          "earfcn", "arfcn", "devn")  # fmt: skip


def is_measurements(names: tuple[str, ...]) -> bool:
    """Whether a header has what a file of measurements needs."""
    return set(NEEDED) <= set(names) and any(name in names for name in IDENTITIES)


def read(source: BinaryIO, layout: Layout, options: Options, account: Account,
         labels: Labels) -> Iterator[Rows]:  # fmt: skip
    """Blocks of a measurements file; rows of other radios are dropped."""
    if not {"earfcn", "arfcn"} & set(layout.names):
        account.note("cells are named by global id: the file tells no EARFCN")
    for block in read_blocks(source, layout, WANTED, account):
        told = (block.texts(name) for name in ("act", "radio", "pci"))
        radio = [_radio(act or radio, pci) for act, radio, pci in zip(*told, strict=True)]
        known = np.array([each is not None for each in radio], bool)
        account.drop(NOT_LTE_OR_NR, block.lines[~known])
        nr = np.array([bool(each) for each in radio], bool)
        yield _rows(block, nr, options, labels).take(known)


def _radio(told: str | None, pci: str | None) -> bool | None:
    """Whether a row is NR; None for 2G and 3G. A row that does not say and has a PCI is LTE's."""
    if told is None or told.strip().lower() in ABSENT:
        return None if whole(pci) is None else False
    return technology(told)


def _rows(block: Block, nr: np.ndarray, options: Options, labels: Labels) -> Rows:
    count = len(block)
    devices = block.texts("devn") if options.device is None else [options.device] * count
    return Rows(
        line=block.lines,
        drive=np.array([labels.drive(DriveLabel(each or None)) for each in devices], np.int32),
        time_s=block.numbers("measured_at", lambda text: _moment_s(text, options)),
        lon=block.numbers("lon", number),
        lat=block.numbers("lat", number),
        speed_mps=block.numbers("speed", _not_negative).astype(np.float32),
        accuracy_m=block.numbers("rating", _not_negative).astype(np.float32),
        cell=_cells(block, labels),
        rsrp_dbm=block.numbers("signal", level_dbm),
        serving=np.full(count, UNKNOWN, np.int8),
        nr=nr,
    )


def _cells(block: Block, labels: Labels) -> np.ndarray:
    identity = "cellid" if "cellid" in block.columns else "cell_id"
    columns = (
        block.texts(name) for name in ("mcc", "mnc", identity, "earfcn", "arfcn", "pci", "psc")
    )
    known: dict[tuple[str | None, ...], int] = {}
    found = []
    for told in zip(*columns, strict=True):
        if told not in known:
            mcc, mnc, cell, earfcn, arfcn, pci, psc = told
            gid = global_id(mcc, mnc, whole(cell))
            pci = pci if whole(pci) is not None else psc
            key = short_key(whole(earfcn or arfcn), whole(pci)) or gid
            known[told] = labels.cell(key, gid)
        found.append(known[told])
    return np.array(found, np.int32)


def _moment_s(text: str, options: Options) -> float:
    """Unix milliseconds, or a date and time in UTC (``yyyy-MM-dd HH:mm:ss.SSS+0000``)."""
    return moment_s(text.strip().strip('"'), options.zone)


def _not_negative(text: str) -> float:
    """A speed or an accuracy; -2000 and other negative numbers are none."""
    value = number(text)
    return value if math.isfinite(value) and value >= 0.0 else math.nan
