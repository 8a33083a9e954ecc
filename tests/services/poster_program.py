"""Posts surveys and says which were accepted: python poster_program.py DATA COUNT."""

from __future__ import annotations

import sys
from pathlib import Path

from app.services.ingest import accept_survey
from app.store.engine import create_store_engine
from tests.factories import line_at, trace_along


def main(data_dir: Path, count: int) -> None:
    engine = create_store_engine(f"sqlite:///{data_dir}/roadprint.sqlite")
    for number in range(count):
        trace = trace_along(line_at(50.0 * (number % 7)), seed=number, road_id=f"r{number % 7}")
        done = accept_survey(engine, trace, idempotency_key=f"drive-{number}")
        print(f"{number} {done.survey_id}", flush=True)  # noqa: T201 - what the test reads


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
