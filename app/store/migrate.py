"""Bringing the database to the newest tables, by however many processes start at once."""

from __future__ import annotations

from pathlib import Path

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Engine

from app.store.engine import read, write
from app.store.tables import SCHEMA_REVISION

MIGRATIONS = Path(__file__).resolve().parents[2] / "migrations"


def revision(engine: Engine) -> str | None:
    """The database's revision, None when it has no tables yet."""
    with read(engine) as connection:
        if not sa.inspect(connection).has_table("alembic_version"):
            return None
        found: str | None = connection.scalar(sa.text("SELECT version_num FROM alembic_version"))
        return found


def migrate(engine: Engine) -> bool:
    """
    Make or change the tables as `migrations/` says; True when there was something to do.

    All of it is one transaction under the write lock: of two processes that start together one
    migrates and the other finds it done, and a killed one leaves nothing half made.
    """
    if revision(engine) == SCHEMA_REVISION:
        return False  # most starts: without the time and the memory that loading Alembic takes
    with write(engine) as connection:
        run_alembic(connection, "head")
    return True


def run_alembic(connection: Connection, target: str, *, down: bool = False) -> None:
    """Move to a revision within the caller's write transaction."""
    from alembic import command  # noqa: PLC0415 - a serving process must not load Alembic
    from alembic.config import Config  # noqa: PLC0415 - the same

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    config.attributes["connection"] = connection
    (command.downgrade if down else command.upgrade)(config, target)
