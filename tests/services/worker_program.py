"""
A worker whose fit takes a given time and makes a model up: python worker_program.py DATA SECONDS.

It is started and killed by the tests of crashes. Roads named ``bad-...`` cannot be built, roads
named ``broken-...`` have a fit that raises what it should not. Each fit leaves a line in
``fits.log``, each finding of roads one in ``finds.log``: what was worked on, however often.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path

from app.domain import Calibration, Road
from app.errors import NotEnoughSamples
from app.numerics.network.finding import find_roads
from app.services.worker import work
from app.settings import Settings
from tests.factories import line_at, model_of


def main(data_dir: Path, seconds_a_road: float, database_url: str | None = None) -> None:
    def fit(road: Road, passes):
        with (data_dir / "fits.log").open("a") as log:
            log.write(f"{os.getpid()} {road.road_id}\n")
        time.sleep(seconds_a_road)
        if road.road_id.startswith("bad-"):
            raise NotEnoughSamples(needed=100, got=len(passes))
        if road.road_id.startswith("broken-"):
            raise ZeroDivisionError("a fault in the fit")
        cells = tuple(sorted({cell for trace in passes for cell in trace.cells}))
        return model_of(road.road_id, seed=len(passes), line=road.line or line_at(), cells=cells)

    def find(driven, known, new_ids):
        with (data_dir / "finds.log").open("a") as log:
            log.write(f"{os.getpid()} {len(driven)}\n")
        time.sleep(seconds_a_road)
        return find_roads(driven, known, new_ids)

    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    settings = Settings(data_dir=data_dir, database_url=database_url)
    work(settings, stop, fit, lambda models: Calibration(window_count=len(models)), find)
    os._exit(0)


if __name__ == "__main__":
    main(Path(sys.argv[1]), float(sys.argv[2]), *sys.argv[3:])
