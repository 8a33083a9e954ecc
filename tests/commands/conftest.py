"""Small data sets as files, and the console command run in this process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from app.cli import app
from app.evaluation.dataset import write_dataset
from app.evaluation.scenario import build_city, preset
from app.evaluation.simulated import city_passes

CITY = build_city(preset("paper"), 21)


@pytest.fixture(scope="session")
def dataset(tmp_path_factory) -> Path:
    """The paper's area on disk: 4 survey passes of 400 samples, 8 test passes."""
    folder = tmp_path_factory.mktemp("files") / "area"
    write_dataset(folder, (truth.road for truth in CITY.roads), city_passes(CITY))
    return folder


@pytest.fixture(scope="session")
def run() -> Callable[..., Result]:
    """Runs ``roadprint`` with these words; standard output and error are kept apart."""
    return lambda *words: CliRunner().invoke(app, [str(word) for word in words])
