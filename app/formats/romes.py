"""R&S ROMES CSV of a scanner: a long preamble, then a row a cell."""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

import numpy as np

from app.formats.account import Account
from app.formats.cells import global_id, short_key, whole
from app.formats.options import Options
from app.formats.rows import UNKNOWN, DriveLabel, Labels, Rows
from app.formats.table import Block, Layout, read_blocks
from app.formats.values import MPS_PER_KMH, UNREADABLE, level_dbm, local_time_s, number

NEEDED = ("date", "time", "latitude", "longitude", "pci", "rsrp")
HEADER_BEGINS = b"date;time;utc;latitude;longitude"
WANTED = (*NEEDED, "speed", "earfcn", "nr-arfcn", "mcc", "mnc", "ci", "nci")


def is_log(names: tuple[str, ...]) -> bool:
    """Whether a header is that of a scanner's table."""
    return set(NEEDED) <= set(names) and bool({"earfcn", "nr-arfcn"} & set(names))


def read(source: BinaryIO, layout: Layout, options: Options, account: Account,
         labels: Labels) -> Iterator[Rows]:  # fmt: skip
    """Blocks of a table. Its UTC column has been seen a month off, so Date and Time count."""
    account.note(f"times without a zone are taken as {options.zone}")
    nr = "nr-arfcn" in layout.names
    for block in read_blocks(source, layout, WANTED, account):
        count = len(block)
        speed_mps = block.numbers("speed", number) * MPS_PER_KMH
        yield Rows(
            line=block.lines,
            drive=np.full(count, labels.drive(DriveLabel(options.device)), np.int32),
            time_s=_times_s(block, options),
            lon=block.numbers("longitude", number),
            lat=block.numbers("latitude", number),
            speed_mps=np.where(np.isfinite(speed_mps), speed_mps, np.nan).astype(np.float32),
            accuracy_m=np.full(count, np.nan, np.float32),
            cell=_cells(block, labels),
            rsrp_dbm=block.numbers("rsrp", level_dbm),
            serving=np.full(count, UNKNOWN, np.int8),
            nr=np.full(count, nr, bool),
        )


def _times_s(block: Block, options: Options) -> np.ndarray:
    """Local date (d.m.yyyy, or yyyy-mm-dd) and time of day."""
    known: dict[tuple[str | None, str | None], float] = {}
    found = []
    for told in zip(block.texts("date"), block.texts("time"), strict=True):
        if told not in known:
            text = f"{(told[0] or '').strip()} {(told[1] or '').strip()}"
            known[told] = local_time_s(text, options.zone) if told[0] and told[1] else UNREADABLE
        found.append(known[told])
    return np.array(found, np.float64)


def _cells(block: Block, labels: Labels) -> np.ndarray:
    columns = (
        block.texts(name) for name in ("earfcn", "nr-arfcn", "pci", "mcc", "mnc", "ci", "nci")
    )
    found = []
    for earfcn, narfcn, pci, mcc, mnc, ci, nci in zip(*columns, strict=True):
        gid = global_id(mcc, mnc, whole(ci) or whole(nci))
        channel = whole(earfcn) if whole(earfcn) is not None else whole(narfcn)
        found.append(labels.cell(short_key(channel, whole(pci)) or gid, gid))
    return np.array(found, np.int32)
