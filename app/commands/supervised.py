"""``python -m app.commands.supervised``: the worker beside `roadprint serve`, logging alike."""

from __future__ import annotations

from app.api.logs import configure_logs
from app.services.worker_process import main

if __name__ == "__main__":
    configure_logs("info")  # the level that is wanted comes with the settings, from the parent
    main()
