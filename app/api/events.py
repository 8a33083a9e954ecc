"""A build as a stream of server-sent events."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from time import monotonic

import orjson
from starlette.concurrency import run_in_threadpool

from app.api.documents import build_document
from app.api.replies import OPTIONS
from app.api.state import State
from app.services.builds import BuildState, get_build

TERMINAL = frozenset({"successful", "failed", "dismissed"})
KEEP_ALIVE = b": still building\n\n"


async def build_events(state: State, build: BuildState) -> AsyncIterator[bytes]:
    """
    One event now and one a change, until the build is finished; comments in longer silences.

    The store is asked in a thread, so that a slow disk holds up nobody else. Before the end is
    told, the map that the build has made is served.
    """
    engine, limits = state["engine"], state["limits"]
    await run_in_threadpool(state["maps"].keep_word, engine, build.map_version)
    yield _event(build)
    spoken_at_s = monotonic()
    while build.status not in TERMINAL:
        await asyncio.sleep(limits.event_poll_interval_s)
        latest = await run_in_threadpool(get_build, engine, build.id)
        if latest != build:
            build = latest
            await run_in_threadpool(state["maps"].keep_word, engine, build.map_version)
            yield _event(build)
            spoken_at_s = monotonic()
        elif monotonic() - spoken_at_s >= limits.event_keep_alive_s:
            yield KEEP_ALIVE
            spoken_at_s = monotonic()


def _event(build: BuildState) -> bytes:
    document = orjson.dumps(build_document(build), option=OPTIONS)
    return b"id: " + build.status.encode() + b"\ndata: " + document + b"\n\n"
