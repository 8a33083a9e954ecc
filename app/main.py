"""
The only place that wires: settings to engine, map, limits, middleware and routes.

Importing this loads neither scipy, ruptures, shapely, DBOS nor Alembic: builds run elsewhere, and a
serving process starts in half the time and half the memory without them.
"""

from __future__ import annotations

import gc
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import Any

from fastapi import FastAPI
from starlette.concurrency import run_in_threadpool
from starlette.types import ASGIApp

from app.api import errors
from app.api.hot import HotPath
from app.api.metrics import Metrics
from app.api.middleware.body import BodyLimit
from app.api.middleware.envelope import Envelope
from app.api.openapi import openapi_document
from app.api.routes import (
    builds,
    cells,
    coverage,
    docs,
    geosubmit,
    health,
    locate,
    maps,
    roads,
    surveys,
)
from app.api.state import Limits, State
from app.services.keys import state_key
from app.services.publish import MapHolder
from app.settings import Settings
from app.store.engine import create_store_engine

VERSION = "0.1.0"
DESCRIPTION = "Road, sub-segment and coordinates from the cellular signal a vehicle hears."


def create_app(settings: Settings) -> FastAPI:
    """The ASGI application; its store must be migrated already (`roadprint serve` does it)."""
    metrics = Metrics(settings.metrics_dir if settings.web_processes > 1 else None)
    app = Application(
        title="roadprint",
        version=VERSION,
        description=DESCRIPTION,
        lifespan=_lifespan(settings, metrics),
        docs_url=None,  # ours needs no foreign host
        redoc_url=None,
        redirect_slashes=False,  # a path with a slash too many is no path, and never a redirect
        telemetry={"tracing": False, "metrics": False, "logs": False},  # /metrics has its own
    )
    app.router.routes.append(locate.hot_route())  # for its place in the interface, and for 405
    for module in (locate, surveys, geosubmit, builds, maps, roads, coverage, cells, health, docs):
        app.include_router(module.router)
    app.router.routes.append(docs.assets())
    errors.install(app)
    app.layers = (
        lambda inner: HotPath(inner, locate.hot_route()),
        lambda inner: BodyLimit(inner, settings.max_body_bytes),
        lambda inner: Envelope(inner, metrics),
    )
    return app


class Application(FastAPI):
    """FastAPI with our layers outside all of its own, from the inmost to the outermost."""

    layers: tuple[Callable[[ASGIApp], ASGIApp], ...] = ()

    def build_middleware_stack(self) -> ASGIApp:
        """The framework's stack within our layers."""
        stack = super().build_middleware_stack()
        for layer in self.layers:
            stack = layer(stack)
        return stack

    def openapi(self) -> dict[str, Any]:
        """The document with problems and self-parsed bodies in it."""
        if self.openapi_schema is None:
            self.openapi_schema = openapi_document(self)
        return self.openapi_schema


def _lifespan(
    settings: Settings, metrics: Metrics
) -> Callable[[FastAPI], AbstractAsyncContextManager[State]]:
    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[State]:
        engine = create_store_engine(settings.store_url, busy_timeout_ms=settings.busy_timeout_ms)
        maps = MapHolder()
        await run_in_threadpool(maps.refresh, engine)
        key = await run_in_threadpool(state_key, engine, settings.state_key)
        gc.freeze()  # what is loaded now stays; the collector need not walk it again
        stop = threading.Event()
        poller = threading.Thread(
            target=maps.poll,
            args=(engine, settings.map_poll_interval_s, stop),
            name="map-poller",
            daemon=True,
        )
        poller.start()
        yield State(
            engine=engine, maps=maps, limits=_limits(settings), metrics=metrics, state_key=key
        )
        stop.set()
        poller.join(timeout=settings.map_poll_interval_s + 1.0)
        engine.dispose()

    return lifespan


def _limits(settings: Settings) -> Limits:
    return Limits(**{name: getattr(settings, name) for name in Limits.__slots__})
