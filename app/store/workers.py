"""Worker processes that say they are alive."""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from app.store.columns import utc_now
from app.store.tables import workers


def beat(connection: Connection, worker_id: str, *, host: str, pid: int) -> None:
    """Count one more beat of a worker, who is entered with the first."""
    changed = connection.execute(
        workers.update().where(workers.c.worker_id == worker_id).values(beats=workers.c.beats + 1)
    )
    if changed.rowcount == 0:
        connection.execute(
            workers.insert().values(
                worker_id=worker_id, host=host, pid=pid, started_at=utc_now(), beats=1
            )
        )


def select_beats(connection: Connection) -> dict[str, int]:
    """How often each worker has beaten so far."""
    rows = connection.execute(sa.select(workers.c.worker_id, workers.c.beats))
    return {row.worker_id: row.beats for row in rows}


def forget(connection: Connection, worker_id: str) -> None:
    """Strike a worker off; if it lives after all, its next beat enters it again."""
    connection.execute(workers.delete().where(workers.c.worker_id == worker_id))
