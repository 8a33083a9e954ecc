"""Migrations equal the tables, run both ways, and stand two processes starting at once."""

from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import sqlalchemy as sa
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory

from app.store.engine import create_store_engine, read, write
from app.store.migrate import MIGRATIONS, migrate, revision, run_alembic
from app.store.tables import SCHEMA_REVISION, metadata


def test_the_migrated_database_equals_the_tables(engine):
    """Alembic's own comparison finds nothing to add, to change or to drop."""
    with read(engine) as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, metadata) == []


def test_sqlite_checks_are_migrated_too(sqlite_engine):
    """CHECK constraints, which the comparison does not see, are those of the tables."""
    inspector = sa.inspect(sqlite_engine)
    for table in metadata.sorted_tables:
        declared = {c.name for c in table.constraints if isinstance(c, sa.CheckConstraint)}
        stored = {check["name"] for check in inspector.get_check_constraints(table.name)}
        assert stored == declared, table.name


def test_the_known_revision_is_the_newest():
    """A start that trusts `SCHEMA_REVISION` trusts the newest file."""
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    assert ScriptDirectory.from_config(config).get_current_head() == SCHEMA_REVISION


def test_down_and_up_again_leaves_the_same_tables(engine):
    """Every revision can be taken back to nothing, and comes again."""
    with write(engine) as connection:
        run_alembic(connection, "base", down=True)
    with read(engine) as connection:
        assert sa.inspect(connection).get_table_names() == ["alembic_version"]
    assert migrate(engine)
    with read(engine) as connection:
        assert compare_metadata(MigrationContext.configure(connection), metadata) == []


def test_migrating_again_changes_nothing(engine):
    """The second start finds nothing to do."""
    assert revision(engine) == SCHEMA_REVISION
    assert not migrate(engine)


def test_two_that_start_at_once_both_succeed(empty_url):
    """Eight starts at the same moment on an empty database: one migrates, nobody fails."""
    engines = [create_store_engine(empty_url) for _ in range(8)]
    together = threading.Barrier(len(engines))

    def start(engine: sa.Engine) -> bool:
        together.wait()
        return migrate(engine)

    with ThreadPoolExecutor(len(engines)) as pool:
        did = list(pool.map(start, engines))
    assert sum(did) >= 1
    assert revision(engines[0]) == SCHEMA_REVISION
    for engine in engines:
        engine.dispose()


def test_a_failing_migration_leaves_nothing_half_made(empty_url, monkeypatch):
    """Tables come in one transaction: a fault within it leaves an empty database."""
    opened = create_store_engine(empty_url)

    def broken(connection: sa.Connection, target: str) -> None:
        run_alembic(connection, target)
        raise RuntimeError("the power went")

    monkeypatch.setattr("app.store.migrate.run_alembic", broken)
    with pytest.raises(RuntimeError):
        migrate(opened)
    with read(opened) as connection:
        assert sa.inspect(connection).get_table_names() == []
    opened.dispose()


def test_an_ordinary_start_loads_no_alembic(sqlite_engine):
    """On a database that is up to date, migrating does not even import Alembic."""
    program = (
        "import sys; from app.store.engine import create_store_engine as c; "
        "from app.store.migrate import migrate; "
        f"migrate(c('sqlite:///{sqlite_engine.url.database}')); "
        "print('alembic' in sys.modules)"
    )
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "False"
