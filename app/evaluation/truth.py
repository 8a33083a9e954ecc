"""A window together with where it truly ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from app.domain import Direction, Window


@dataclass(frozen=True, slots=True)
class Truth:
    """Where the last sample of a window was: WGS 84 degrees, chainage along its road's line."""

    road_id: str
    chainage_m: float
    direction: Direction
    lon: float
    lat: float


class Labelled(NamedTuple):
    """What a vehicle heard, and where it was."""

    window: Window
    truth: Truth
