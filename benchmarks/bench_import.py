"""
What an import costs: rows a second and resident memory, on a generated file of any size.

    python benchmarks/bench_import.py --megabytes 500

Three children read the same file, each measured alone: parse and assemble with Arrow, the same with
the plain reader (a tenth of the file), and ``roadprint import --no-build`` through to the store.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from app.formats.account import Account
from app.formats.options import Options
from app.formats.read import read_drives
from app.formats.sniff import sniff
from app.formats.source import open_source

HEADER = "trace_id,timestamp_s,lat,lon,speed_mps,cell_id,rsrp_dbm,serving\n"
DRIVE_S = 3600  # an hour at one sample a second
CELLS_HEARD, CELLS_OF_A_DRIVE = 10, 80
MEGABYTE = 1_000_000


def drives(seed: int) -> Iterator[str]:
    """
    Tidy rows drive by drive: ten cells a second out of eighty, as scanning phones write them.

    Each drive is a place of its own, so that storing one compares it with few roads: what finding
    roads costs is not measured here.
    """
    rng = np.random.default_rng(seed)
    number = 0
    while True:
        start_s = 1_700_000_000 + 5000 * number
        heading = rng.normal(0.0, 0.05, DRIVE_S).cumsum()
        lat = -60.0 + 0.05 * (number % 2400) + (1e-4 * np.cos(heading)).cumsum()
        lon = 11.0 + (1.5e-4 * np.sin(heading)).cumsum()
        cells = [f"{earfcn}:{pci}" for earfcn in (850, 2850, 5110, 66486)
                 for pci in rng.choice(504, CELLS_OF_A_DRIVE // 4, replace=False)]  # fmt: skip
        heard = (np.arange(DRIVE_S)[:, None] // 40 + np.arange(CELLS_HEARD)) % CELLS_OF_A_DRIVE
        level_dbm = np.round(rng.normal(-95.0, 8.0, heard.shape).clip(-139, -45), 2)
        yield "".join(
            f"drive-{number:04d},{start_s + i}.0,{lat[i]:.7f},{lon[i]:.7f},,"
            f"{cells[heard[i, k]]},{level_dbm[i, k]},{int(k == 0)}\n"
            for i in range(DRIVE_S)
            for k in range(CELLS_HEARD)
        )
        number += 1


def write_file(path: Path, megabytes: int, seed: int) -> int:
    """A file of at least this size; its rows."""
    rows = 0
    with path.open("w", encoding="utf-8") as file:
        file.write(HEADER)
        for text in drives(seed):
            file.write(text)
            rows += DRIVE_S * CELLS_HEARD
            if file.tell() >= megabytes * MEGABYTE:
                return rows
    return rows


def read(path: Path, *, fast: bool) -> None:
    """Parse and assemble in this process, and print how long it took."""
    account = Account()
    began_s = time.perf_counter()
    with open_source(path) as (source, _):
        for _drive in read_drives(source, sniff(source), Options(fast=fast), account):
            pass
    took_s = time.perf_counter() - began_s
    print(f"{account.rows} {account.drives} {took_s:.3f} {resident_mb():.0f}")


def resident_mb() -> float:
    """Most memory that this process ever had resident."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measured(name: str, command: list[str], rows: int) -> None:
    """One child, with its most memory and its processor time."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began_s = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    took_s = time.perf_counter() - began_s
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        sys.exit(done.stdout + done.stderr)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    words = done.stdout.split()
    inner_s, inside = (float(words[2]), words[3]) if len(words) == 4 else (took_s, "")
    print(f"{name:34} {rows / inner_s:>10,.0f} rows/s {rows / cpu_s:>10,.0f} rows/cpu-s "
          f"{inside or f'{after.ru_maxrss / 1024:.0f}':>6} MB")  # fmt: skip


def main() -> None:
    """Make the file, measure, print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--megabytes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--read", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--plain", action="store_true", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.read is not None:
        read(asked.read, fast=not asked.plain)
        return
    with tempfile.TemporaryDirectory() as folder:
        whole, tenth = Path(folder, "drives.csv"), Path(folder, "tenth.csv")
        rows = write_file(whole, asked.megabytes, asked.seed)
        few = write_file(tenth, asked.megabytes // 10, asked.seed)
        print(f"{whole.stat().st_size / MEGABYTE:,.0f} MB, {rows:,} rows")
        me = [sys.executable, __file__, "--read"]
        measured("parse and assemble, plain (tenth)", [*me, str(tenth), "--plain"], few)
        measured("parse and assemble", [*me, str(whole)], rows)
        command = ["-m", "app", "import", str(whole), "--data", f"{folder}/store", "--no-build"]
        measured("through to the store", [sys.executable, *command], rows)


if __name__ == "__main__":
    main()
