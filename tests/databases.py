"""Empty databases for tests: SQLite files, and a PostgreSQL server where its programs are."""

from __future__ import annotations

import getpass
import os
import pwd
import shutil
import socket
import subprocess
import tempfile
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
import sqlalchemy as sa

from app.store.engine import create_store_engine
from app.store.migrate import migrate

POSTGRES = pytest.param("postgresql", marks=pytest.mark.postgresql)


def server_programs() -> Path | None:
    """The folder with initdb and pg_ctl: Debian keeps them off the path."""
    found = shutil.which("initdb")
    folders = [Path(found).parent] if found else []
    folders += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    return next((folder for folder in folders if (folder / "pg_ctl").exists()), None)


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[str]:
    """URL of a server on a free loopback port that lives as long as the test session."""
    programs = server_programs()
    if programs is None:
        pytest.skip("PostgreSQL's server programs (Debian package postgresql) are not installed")
    user = _server_user()
    folder = Path(tempfile.mkdtemp(prefix="roadprint-postgres-"))
    if user != getpass.getuser():
        shutil.chown(folder, user)
    port = _free_port()

    def run(*command: str) -> None:
        subprocess.run(
            command, check=True, user=user, cwd=folder, stdout=subprocess.DEVNULL, timeout=60
        )

    cluster = str(folder / "cluster")
    settings = f"-p {port} -c listen_addresses=127.0.0.1 -c fsync=off -k {folder}"
    run(str(programs / "initdb"), "-D", cluster, "-U", "road", "-A", "trust", "--no-sync")
    run(str(programs / "pg_ctl"), "-D", cluster, "-o", settings, "-l", f"{folder}/log", "start")
    try:
        yield f"postgresql://road@127.0.0.1:{port}"
    finally:
        run(str(programs / "pg_ctl"), "-D", cluster, "-m", "immediate", "stop")
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def postgres_url(postgres_server: str) -> str:
    """URL of an empty PostgreSQL database."""
    name = f"test_{uuid.uuid4().hex}"
    create_database(postgres_server, name)
    return f"{postgres_server}/{name}"


@pytest.fixture(params=["sqlite", POSTGRES])
def empty_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """URL of a database without tables, once of each kind."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path}/store.sqlite"
    return request.getfixturevalue("postgres_url")


@pytest.fixture(scope="session")
def migrated_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A SQLite file with all tables, to be copied: migrating takes a tenth of a second."""
    path = tmp_path_factory.mktemp("template") / "migrated.sqlite"
    opened = create_store_engine(f"sqlite:///{path}")
    migrate(opened)
    opened.dispose()  # the last connection moves the WAL into the file
    return path


@pytest.fixture(scope="session")
def migrated_postgres(postgres_server: str) -> str:
    """A PostgreSQL database with all tables, to be copied."""
    create_database(postgres_server, "migrated")
    opened = create_store_engine(f"{postgres_server}/migrated")
    migrate(opened)
    opened.dispose()  # a database somebody is connected to cannot be copied
    return "migrated"


@pytest.fixture
def migrated_postgres_url(postgres_server: str, migrated_postgres: str) -> Iterator[str]:
    """URL of a PostgreSQL database with all tables and nothing in them."""
    name = f"test_{uuid.uuid4().hex}"
    create_database(postgres_server, name, template=migrated_postgres)
    yield f"{postgres_server}/{name}"
    run_as_admin(postgres_server, f"DROP DATABASE {name} WITH (FORCE)")


@pytest.fixture
def sqlite_engine(tmp_path: Path, migrated_file: Path) -> Iterator[sa.Engine]:
    """A migrated store in a SQLite file."""
    path = shutil.copy(migrated_file, tmp_path / "store.sqlite")
    opened = create_store_engine(f"sqlite:///{path}")
    yield opened
    opened.dispose()


@pytest.fixture(params=["sqlite", POSTGRES])
def engine(request: pytest.FixtureRequest) -> Iterator[sa.Engine]:
    """A migrated store, once on each kind of database."""
    if request.param == "sqlite":
        yield request.getfixturevalue("sqlite_engine")
        return
    opened = create_store_engine(request.getfixturevalue("migrated_postgres_url"))
    yield opened
    opened.dispose()


def create_database(server: str, name: str, template: str = "template0") -> None:
    """A database made by copying another."""
    run_as_admin(server, f"CREATE DATABASE {name} TEMPLATE {template} STRATEGY FILE_COPY")


def run_as_admin(server: str, statement: str) -> None:
    admin = create_store_engine(f"{server}/postgres")
    with admin.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        connection.execute(sa.text(statement))
    admin.dispose()


def _server_user() -> str:
    """PostgreSQL refuses to run as root; Debian's package makes a user for it."""
    if os.geteuid() != 0:
        return getpass.getuser()
    try:
        return pwd.getpwnam("postgres").pw_name
    except KeyError:
        pytest.skip("PostgreSQL does not run as root and there is no user postgres")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
