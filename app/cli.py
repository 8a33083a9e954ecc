"""
The console command: one line a subcommand, nothing else.

Each subcommand is a function of the same name in `app.commands.<module>`, with typer annotations
and a docstring that teaches. A module is imported only when its subcommand is asked for, so that
`roadprint serve` never loads what only a build or an evaluation needs (scipy, ruptures).
"""

from __future__ import annotations

import importlib
import keyword
from typing import Any

import typer
from typer.core import TyperGroup

COMMANDS: dict[str, str] = {
    "serve": "app.commands.serve",
    "worker": "app.commands.worker",
    "demo": "app.commands.demo",
    "doctor": "app.commands.doctor",
    "import": "app.commands.import_",
    "build": "app.commands.build",
    "locate": "app.commands.locate",
    "coverage": "app.commands.coverage",
    "roads": "app.commands.roads",
    "simulate": "app.commands.simulate",
    "evaluate": "app.commands.evaluate",
    "openapi": "app.commands.openapi",
}
"""
Subcommand -> the module whose function, or group of functions, of that name it runs.

Add a line to add a subcommand.
"""


class LazyGroup(TyperGroup):
    """A group of subcommands whose modules load when they are called or listed."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 - click's signature
        """Names in the order of the table, the way a newcomer meets them."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002 - the same
        """The typer command of one subcommand, or None when there is no such name."""
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(COMMANDS[cmd_name])
        command = getattr(module, _function_name(cmd_name))
        if isinstance(command, typer.Typer):  # a group of its own
            return typer.main.get_command(command)
        single = typer.Typer(add_completion=False, rich_markup_mode="markdown")
        single.command(cmd_name)(command)
        return typer.main.get_command(single)


def _function_name(command: str) -> str:
    """The subcommand's name, with an underscore where Python keeps the word for itself."""
    return f"{command}_" if keyword.iskeyword(command) else command


app = typer.Typer(
    cls=LazyGroup, add_completion=False, no_args_is_help=True, rich_markup_mode="markdown"
)


@app.callback()
def roadprint() -> None:
    """Road-aware localisation from cellular signals: maps from drives, fixes from windows."""


def main() -> None:
    """Entry point of the ``roadprint`` console command and of ``python -m app``."""
    app()
