"""What a request may reach: the typed state that the lifespan yields, and how to ask for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, cast

from fastapi import Depends, Request
from sqlalchemy import Engine
from typing_extensions import TypedDict

from app.api.metrics import Metrics
from app.errors import NoMap
from app.numerics.index import MapIndex
from app.services.publish import MapHolder


@dataclass(frozen=True, slots=True)
class Limits:
    """How much one request may ask for, and how an event stream paces itself."""

    max_body_bytes: int
    max_window_samples: int
    max_window_cells: int
    max_batch_windows: int
    event_poll_interval_s: float
    event_keep_alive_s: float


class State(TypedDict):
    """The lifespan's state; every request's scope carries it."""

    engine: Engine
    maps: MapHolder
    limits: Limits
    metrics: Metrics
    state_key: bytes  # signs tracking states


def current_map(state: State) -> MapIndex:
    """
    The index of the active map.

    Raises:
        NoMap: None is loaded yet.
    """
    index = state["maps"].current
    if index is None:
        raise NoMap
    return index


# Coroutines, because FastAPI runs plain functions in a thread, which costs more than they do.
async def _state(request: Request) -> State:
    return cast("State", request.scope["state"])


async def _engine(request: Request) -> Engine:
    return cast("State", request.scope["state"])["engine"]


StateOf = Annotated[State, Depends(_state)]
EngineOf = Annotated[Engine, Depends(_engine)]
