"""How every subcommand that runs on a data folder comes by its settings."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError

from app.settings import ENV_PREFIX, Settings

DataDir = Annotated[
    Path | None,
    typer.Option(
        "--data",
        metavar="DIR",
        help="Folder of the SQLite files; made when absent. [env: ROADPRINT_DATA_DIR]",
        show_default="var/roadprint",
    ),
]


def chosen_settings(**options: object) -> Settings:
    """
    The environment's settings under the options that were given.

    Raises:
        typer.Exit: A value is wrong; said on standard error.
    """
    try:
        return Settings.from_environment(os.environ, **options)
    except ValidationError as error:
        for fault in error.errors():
            name = str(fault["loc"][0])
            where = f"--{name.replace('_', '-')} or {ENV_PREFIX}{name.upper()}"
            typer.echo(f"{where}: {fault['msg']}, got {fault['input']!r}", err=True)
        raise typer.Exit(2) from None
