"""`roadprint openapi`: the HTTP interface as a document."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from app.main import create_app
from app.settings import Settings


def openapi(
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write here instead of standard output."),
    ] = None,
) -> None:
    """
    Print the OpenAPI document of the HTTP interface.

    It is the one that a running service has at /openapi.json, and the repository keeps as
    openapi/openapi.json. Nothing is started and no data is touched.
    """
    text = json.dumps(create_app(Settings()).openapi(), indent=2, ensure_ascii=False) + "\n"
    if out is None:
        typer.echo(text, nl=False)
    else:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text, encoding="utf-8")
