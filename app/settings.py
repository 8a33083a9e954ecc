"""
Frozen settings, units in the names.

Only the edges (`app.cli` and its commands, `app.main`, `migrations/env.py`) read the environment;
everything within is handed a `Settings`. `docs/operations.md` lists every field with its variable.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

ENV_PREFIX = "ROADPRINT_"
SQLITE_FILE = "roadprint.sqlite"

LogLevel = Literal["debug", "info", "warning", "error"]


class Settings(BaseModel):
    """What an operator may choose; every field is ``ROADPRINT_<FIELD>`` in the environment."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    data_dir: Path = Field(
        default=Path("var/roadprint"), description="Folder of the SQLite files; made when absent."
    )
    database_url: str | None = Field(
        default=None,
        description="SQLAlchemy URL of the store; empty: a SQLite file in the data folder.",
    )
    host: str = Field(default="127.0.0.1", description="Address the API listens on.")
    port: int = Field(default=8000, ge=0, le=65535, description="Port of the API; 0: any free one.")
    web_processes: int = Field(
        default=1, ge=1, le=64, description="API processes that share the port."
    )
    max_body_bytes: int = Field(
        default=32 * 1024 * 1024,
        ge=1024,
        description="Largest request body, counted as sent and again as unpacked (413 beyond).",
    )
    max_window_samples: int = Field(
        default=4096, ge=1, description="Most samples in one window of a locate request."
    )
    max_window_cells: int = Field(
        default=512, ge=1, description="Most cells in one window of a locate request."
    )
    max_batch_windows: int = Field(
        default=1000, ge=1, description="Most windows in one locate/batch request."
    )
    map_poll_interval_s: float = Field(
        default=0.5, gt=0, description="How often a process asks whether another map is active."
    )
    event_poll_interval_s: float = Field(
        default=0.5, gt=0, description="How often an event stream looks at its build."
    )
    event_keep_alive_s: float = Field(
        default=15.0, gt=0, description="Longest silence of an event stream."
    )
    busy_timeout_ms: int = Field(
        default=10_000, ge=0, description="How long a SQLite writer waits for another."
    )
    state_key: str | None = Field(
        default=None,
        repr=False,
        description="Secret that signs tracking states; empty: one that the store makes and keeps.",
    )
    log_level: LogLevel = Field(default="info", description="Least level that is logged.")

    @property
    def store_url(self) -> str:
        """The SQLAlchemy URL in force: ``database_url``, or the SQLite file of the data folder."""
        return self.database_url or f"sqlite:///{self.data_dir.absolute() / SQLITE_FILE}"

    @property
    def metrics_dir(self) -> Path:
        """Where several API processes keep the counters that `/metrics` adds up."""
        return self.data_dir.absolute() / "metrics"

    def to_environment(self) -> dict[str, str]:
        """These settings as variables, for processes that inherit an environment."""
        return {
            ENV_PREFIX + name.upper(): str(value)
            for name in type(self).model_fields
            if (value := getattr(self, name)) is not None
        }

    @classmethod
    def from_environment(cls, environ: Mapping[str, str], **overrides: object) -> Settings:
        """
        Settings of the environment, under ``overrides`` whose value is not None.

        An empty variable counts as absent, so that compose files may pass it through.

        Raises:
            ValueError: A variable has a value that its field cannot take.
        """
        found = {
            name: environ[variable]
            for name in cls.model_fields
            if environ.get(variable := ENV_PREFIX + name.upper())
        }
        chosen = {name: value for name, value in overrides.items() if value is not None}
        return cls.model_validate({**found, **chosen})
