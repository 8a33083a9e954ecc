"""Fixes as columns, on disk and in memory; each job's file is whole or absent."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from app.evaluation.experiments.fingerprint import fingerprint
from app.evaluation.experiments.plan import Job
from app.evaluation.experiments.run import Outcome

SCHEMA = pa.schema(
    [
        ("job", pa.string()),
        ("seed", pa.int64()),
        ("protocol", pa.string()),
        ("window_m", pa.float64()),
        ("number", pa.int64()),
        ("drive", pa.int64()),
        ("samples", pa.int64()),
        ("travelled_m", pa.float64()),
        ("true_road", pa.string()),
        ("true_chainage_m", pa.float64()),
        ("true_direction", pa.string()),
        ("true_lon", pa.float64()),
        ("true_lat", pa.float64()),
        ("least_sd_m", pa.float64()),
        ("method", pa.string()),
        ("road", pa.string()),
        ("chainage_m", pa.float64()),
        ("direction", pa.string()),
        ("lon", pa.float64()),
        ("lat", pa.float64()),
        ("located", pa.bool_()),
        ("error_m", pa.float64()),
        ("along_m", pa.float64()),
        ("road_right", pa.bool_()),
        ("direction_right", pa.bool_()),
        ("posterior", pa.float64()),
        ("segment_right", pa.bool_()),
        ("radius68_m", pa.float64()),
        ("radius95_m", pa.float64()),
        ("recall", pa.float64()),
        ("delay_ms", pa.float64()),
    ]
)


class Shelf:
    """Finished jobs in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "jobs"
        self._folder.mkdir(parents=True, exist_ok=True)

    def has(self, job: Job) -> bool:
        """Whether the job was finished by this state of the code, in this run or an earlier one."""
        path = self._path(job)
        if not path.is_file():
            return False
        about = pq.read_schema(path).metadata or {}
        return bool(about.get(b"code") == fingerprint().encode())

    def put(self, job: Job, outcome: Outcome) -> None:
        """Keep a finished job; a process killed meanwhile leaves nothing half written."""
        table = pa.Table.from_pylist(outcome.rows, schema=SCHEMA)
        about = {
            "methods": json.dumps(outcome.methods),
            "took_s": str(outcome.took_s),
            "code": fingerprint(),
        }
        part = self._path(job).with_suffix(".part")
        pq.write_table(table.replace_schema_metadata(about), part)
        part.replace(self._path(job))

    def read(self, job: Job) -> pa.Table:
        """The fixes of a finished job."""
        return pq.read_table(self._path(job))

    def methods(self, job: Job) -> dict[str, dict[str, Any]]:
        """What each method chose and took to learn."""
        about = pq.read_schema(self._path(job)).metadata or {}
        return dict(json.loads(about[b"methods"]))

    def took_s(self, job: Job) -> float:
        """How long a finished job took."""
        about = pq.read_schema(self._path(job)).metadata or {}
        return float(about[b"took_s"])

    def _path(self, job: Job) -> Path:
        return self._folder / f"{job.key}.parquet"


def write_fixes(folder: Path, tables: Sequence[pa.Table]) -> pa.Table:
    """Every single fix as ``fixes.csv`` and ``fixes.parquet``."""
    plain = [table.replace_schema_metadata(None) for table in tables]
    table = pa.concat_tables(plain) if plain else SCHEMA.empty_table()
    pq.write_table(table, folder / "fixes.parquet")
    pa_csv.write_csv(table, folder / "fixes.csv")
    return table


def write_rows(path: Path, rows: Iterable[dict[str, Any]]) -> None:
    """A small table as CSV."""
    pa_csv.write_csv(pa.Table.from_pylist(list(rows)), path)
