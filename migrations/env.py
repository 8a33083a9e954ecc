"""Alembic's entry: runs within a connection it is handed, or opens the store of the environment."""

from __future__ import annotations

import os

from alembic import context
from sqlalchemy.engine import Connection

from app.settings import Settings
from app.store.engine import create_store_engine, write
from app.store.tables import metadata


def run(connection: Connection) -> None:
    """Run the revisions in the transaction that the connection is in."""
    context.configure(
        connection=connection,
        target_metadata=metadata,
        transactional_ddl=True,  # SQLite too: the engine begins its transactions itself
        render_as_batch=True,  # SQLite alters tables by copying them
        compare_type=True,
    )
    with context.begin_transaction():
        context.run_migrations()


if context.is_offline_mode():
    raise NotImplementedError("roadprint migrates a database, it prints no SQL scripts")

handed = context.config.attributes.get("connection")
if handed is not None:
    run(handed)
else:
    settings = Settings.from_environment(os.environ)
    with write(create_store_engine(settings.store_url)) as opened:
        run(opened)
