"""
Finds roads of drives that wait, and dies of kill -9: python finding_program.py DATA BUILD AT.

``AT`` is ``finding``, ``committed``, or the number of the writing statement before whose commit it
dies; 0 lets it live.
"""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import sqlalchemy as sa

from app.numerics.network.finding import find_roads
from app.services import network, roadwork
from app.store.engine import create_store_engine

WRITING = ("INSERT", "UPDATE", "DELETE")


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def main(data_dir: Path, build_id: str, at: str) -> None:
    engine = create_store_engine(f"sqlite:///{data_dir}/roadprint.sqlite")
    roadwork.begin_build(engine, build_id)
    written = 0

    def find(driven, known, new_ids):
        found = find_roads(driven, known, new_ids)
        if at == "finding":
            die()
        return found

    @sa.event.listens_for(engine, "after_cursor_execute")
    def count(connection, cursor, statement, *_):
        nonlocal written
        written += statement.lstrip().upper().startswith(WRITING)
        if str(written) == at:
            die()

    if at == "committed":

        @sa.event.listens_for(sa.engine.Connection, "commit")
        def gone(connection):
            # The event comes before the driver's own commit: do that, and be no more.
            if written:
                connection.connection.driver_connection.execute("COMMIT")
                die()

    network.place_drives(engine, find, build_id)
    print(written, flush=True)  # noqa: T201 - what the test reads


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], sys.argv[3])
