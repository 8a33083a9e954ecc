"""A parent that keeps a worker and says its process id: python parent_program.py DATA."""

from __future__ import annotations

import sys
import time
from pathlib import Path

from app.services.supervisor import start_worker_process
from app.settings import Settings

if __name__ == "__main__":
    handle = start_worker_process(Settings(data_dir=Path(sys.argv[1])))
    print(handle.pid, flush=True)  # noqa: T201 - what the test reads
    time.sleep(600)
