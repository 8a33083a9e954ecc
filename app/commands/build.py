"""`roadprint build`: make the map anew."""

from __future__ import annotations

from typing import Annotated

import typer

from app.commands.console import Url, conclude, follow_build, open_target
from app.commands.settings import DataDir


def build(
    road_id: Annotated[
        list[str] | None,
        typer.Option(help="A road to build anew; may be given again. All roads without it."),
    ] = None,
    url: Url = None,
    data: DataDir = None,
) -> None:
    """
    Build a new map version from the stored surveys and make it the active one.

    Roads that cannot be built are named with the reason; the others are built all the same.
    """
    with open_target(url, data) as target:
        requested = target.request_build(road_id or None)
        conclude(target, follow_build(target, requested))
