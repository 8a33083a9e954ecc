"""
``python -m app.services.worker_process``: a worker whose parent is `app.services.supervisor`.

Reads its settings as one line of JSON from standard input and ends when that is closed.
"""

from __future__ import annotations

import logging
import os
import sys
import threading

from app.services.worker import run_worker
from app.settings import Settings


def main() -> None:
    """Be the worker that the parent asks for."""
    settings = Settings.model_validate_json(sys.stdin.readline())
    logging.basicConfig(
        level=settings.log_level.upper(), format="%(asctime)s %(levelname)s %(name)s: %(message)s"
    )
    logging.getLogger().setLevel(settings.log_level.upper())  # handlers may have stood before
    logging.getLogger("alembic").setLevel(logging.WARNING)  # it names every plugin it loads
    threading.Thread(target=_end_with_parent, name="parent-watch", daemon=True).start()
    run_worker(settings)


def _end_with_parent() -> None:
    sys.stdin.read()  # returns when the parent hangs up or dies
    os._exit(0)  # a worker may be cut off anywhere: what it was at is taken up again


if __name__ == "__main__":
    main()
