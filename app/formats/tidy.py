"""Tidy CSV: a row a reading, rows of one drive, time and place are one sample."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from app.formats.account import Account, WrongFile
from app.formats.arrow_table import read_blocks_fast
from app.formats.cells import ABSENT
from app.formats.options import Options
from app.formats.rows import UNKNOWN, DriveLabel, Labels, Rows
from app.formats.table import Block, Column, Layout, read_blocks
from app.formats.values import level_dbm, moment_s, number

TIMES = ("time_s", "timestamp_s")
DRIVES = ("pass_id", "trace_id", "drive_id")
NEEDED = ("lon", "lat", "cell_id", "rsrp_dbm")
OPTIONAL = ("device", "speed_mps", "accuracy_m", "serving", "radio")


def is_tidy(names: tuple[str, ...]) -> bool:
    """Whether a header has what a tidy table needs."""
    return set(NEEDED) <= set(names) and any(name in names for name in TIMES)


def read(source: BinaryIO, layout: Layout, options: Options, account: Account,
         labels: Labels) -> Iterator[Rows]:  # fmt: skip
    """
    Blocks of a tidy table.

    Raises:
        WrongFile: A column is missing or stands twice.
    """
    missing = [name for name in NEEDED if name not in layout.names]
    time = next((name for name in TIMES if name in layout.names), None)
    if missing or time is None:
        told = missing + ([] if time else [" or ".join(TIMES)])
        raise WrongFile(f"no column {', '.join(told)} among {', '.join(layout.names)[:200]}")
    key = next((name for name in DRIVES if name in layout.names), None)
    wanted = [*NEEDED, time, *OPTIONAL, *([key] if key else [])]
    blocks = read_blocks_fast if options.fast else read_blocks
    for block in blocks(source, layout, wanted, account):
        yield _rows(block, time, key, options, labels)


def _rows(block: Block, time: str, key: str | None, options: Options, labels: Labels) -> Rows:
    return Rows(
        line=block.lines,
        drive=_drives(block, key, options, labels),
        time_s=block.numbers(time, lambda text: moment_s(text, options.zone)),
        lon=block.numbers("lon", number),
        lat=block.numbers("lat", number),
        speed_mps=block.numbers("speed_mps", number).astype(np.float32),
        accuracy_m=block.numbers("accuracy_m", number).astype(np.float32),
        cell=coded(block.columns["cell_id"], lambda text: labels.cell(_cell(text))),
        rsrp_dbm=block.numbers("rsrp_dbm", level_dbm),
        serving=np.nan_to_num(block.numbers("serving", _serving), nan=UNKNOWN).astype(np.int8),
        nr=block.numbers("radio", lambda text: float(text.strip().lower() == "nr")) == 1.0,
    )


def _cell(text: str) -> str | None:
    return None if text.strip().lower() in ABSENT else text.strip()


def _serving(text: str) -> float:
    return {"1": 1.0, "true": 1.0, "0": 0.0, "false": 0.0}.get(text.strip().lower(), float(UNKNOWN))


def _drives(block: Block, key: str | None, options: Options, labels: Labels) -> NDArray[np.int32]:
    """Drive of each row: its name when the table has one, its device when it tells that."""
    names = block.columns.get(key) if key else None
    devices = block.columns.get("device") if options.device is None else None
    if devices is None:
        if names is None:
            only = labels.drive(DriveLabel(options.device))
            return np.full(len(block), only, np.int32)
        return coded(names, lambda text: labels.drive(DriveLabel(options.device, text or None)))
    told = zip(devices.texts(), names.texts() if names else [""] * len(block), strict=True)
    each = [labels.drive(DriveLabel(device or None, name or None)) for device, name in told]
    return np.array(each, np.int32)


def coded(column: Column, number_of: Callable[[str], int]) -> NDArray[np.int32]:
    """Each row's number of a label; each distinct text is looked up once."""
    return np.array([number_of(text) for text in column.values], np.int32)[column.codes]
