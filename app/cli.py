"""
The console command: one line a subcommand, nothing else.

Each subcommand is a function of the same name in `app.commands.<module>`, with typer annotations and
a docstring that teaches. A module is imported only when its subcommand is asked for, so that
`roadprint serve` never loads what only a build or an evaluation needs (scipy, ruptures, matplotlib).
"""

from __future__ import annotations

import importlib
from typing import Any

import typer
from typer.core import TyperGroup

COMMANDS: dict[str, str] = {}
"""Subcommand -> the module whose function of that name it runs. Add a line to add a subcommand."""


class LazyGroup(TyperGroup):
    """A group of subcommands whose modules load when they are called or listed."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Names in the order of the table, the way a newcomer meets them."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The typer command of one subcommand, or None when there is no such name."""
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(COMMANDS[cmd_name])
        single = typer.Typer(add_completion=False, rich_markup_mode="rich")
        single.command(cmd_name)(getattr(module, cmd_name))
        return typer.main.get_command(single)


app = typer.Typer(cls=LazyGroup, add_completion=False, no_args_is_help=True, rich_markup_mode="rich")


@app.callback()
def roadprint() -> None:
    """Road-aware localisation from cellular signal strength: maps from drives, fixes from windows."""


def main() -> None:
    """Entry point of the ``roadprint`` console command and of ``python -m app``."""
    app()
