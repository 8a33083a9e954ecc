"""`roadprint worker`: a further build worker."""

from __future__ import annotations

from app.api.logs import configure_logs
from app.commands.settings import DataDir, chosen_settings
from app.services.worker import run_worker


def worker(data: DataDir = None) -> None:
    """
    Run one more build worker until Ctrl-C.

    `roadprint serve` has one already; workers on the same store share the builds road by road, so a
    second one about halves a large build on a machine with idle cores. Killing a worker at any
    moment loses nothing: another takes over where it stopped, or itself when it is started again.

    With PostgreSQL (ROADPRINT_DATABASE_URL) workers may run on other machines.
    """
    settings = chosen_settings(data_dir=data)
    configure_logs(settings.log_level)
    run_worker(settings)
