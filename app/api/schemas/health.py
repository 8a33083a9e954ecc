"""Health answers."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel


class Alive(BaseModel):
    """The process answers."""

    status: Literal["alive"]


class Ready(BaseModel):
    """The store can be reached."""

    status: Literal["ready"]
    map_version: int | None
    active_map_version: int | None
