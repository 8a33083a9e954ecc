"""Explained answers as tables."""

from __future__ import annotations

import io
from typing import Any

import orjson
import pytest
from rich.console import Console

from app.api.explanations import explanation_document
from app.commands.explain import explanation_tables
from app.domain import Window
from app.evaluation.scenario import windows
from app.numerics.matching import locate
from tests.numerics.cities import city_of, index_of


def printed(document: dict[str, Any]) -> str:
    console = Console(width=140, file=io.StringIO())
    console.print(explanation_tables(document))
    return console.file.getvalue()


def told_of(window: Window) -> dict[str, Any]:
    """As it comes over HTTP: NaN is null."""
    document = explanation_document(index_of(), window, locate(index_of(), window))
    return orjson.loads(orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY))


@pytest.mark.parametrize("number", [0, 7])
def test_the_tables_add_up_and_say_what_the_answer_says(number: int):
    """The printed totals are the printed difference; every sentence is there."""
    told = told_of(windows(city_of(), 8)[number].window)
    text = printed(told)
    lines = [line.replace("│", " ").replace("┃", " ").split() for line in text.splitlines()]
    cells = {one["cell"] for one in told["cells"]}
    parts = [float(line[3]) for line in lines if line and line[0] in cells and len(line) > 4]
    offset = next(float(line[-1]) for line in lines if line[:2] == ["device", "offset"])
    together = next(float(line[-1]) for line in lines if line and line[0] == "together")
    assert sum(parts[: len(cells)]) + offset == pytest.approx(together, abs=0.05)
    flat = " ".join(text.split())
    assert all(" ".join(sentence.split()) in flat for sentence in told["words"])
    assert "readings minus the fit" in text


def test_nothing_known_is_printed_too():
    """A window of strange cells has its sentence, and tables without rows."""
    window = windows(city_of(), 1)[0].window
    text = printed(told_of(Window(("x",), window.distance_m, window.rsrp_dbm[:, :1])))
    assert "None of the window's cells is on the map" in text
