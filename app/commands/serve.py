"""`roadprint serve`: the API with a build worker beside it."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Annotated

import typer
import uvicorn
from fastapi import FastAPI
from uvicorn.supervisors import Multiprocess

from app.api.logs import configure_logs
from app.commands.settings import DataDir, chosen_settings
from app.main import create_app
from app.services.supervisor import WorkerHandle
from app.settings import Settings
from app.store.engine import create_store_engine, warn_of_old_sqlite
from app.store.migrate import migrate

GRACE_S = 5  # for answers under way; an event stream would otherwise hold the server up for ever
PARENT_CHECK_S = 1.0
WORKER = (sys.executable, "-m", "app.commands.supervised")


def serve(
    data: DataDir = None,
    host: Annotated[
        str | None,
        typer.Option(help="Address to listen on; 0.0.0.0 is every one.", show_default="127.0.0.1"),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(help="Port to listen on; 0 is any free one.", show_default="8000"),
    ] = None,
    web_processes: Annotated[
        int | None,
        typer.Option("--workers", metavar="N", help="API processes.", show_default="1"),
    ] = None,
    *,
    worker: Annotated[
        bool, typer.Option(help="Start a build worker beside the API, and keep it running.")
    ] = True,
) -> None:
    """
    Serve the HTTP API until Ctrl-C, with one build worker beside it.

    The data folder is made and its tables are brought up to date first. Everything accepted
    survives kill -9 and is built after the next start. Options win over ROADPRINT_* variables; all
    of them are listed in docs/operations.md.

    Try it: roadprint demo, then roadprint serve --data demo-data, then open /docs.
    """
    settings = chosen_settings(data_dir=data, host=host, port=port, web_processes=web_processes)
    configure_logs(settings.log_level)
    listening = _listen(settings)
    settings = settings.model_copy(update={"port": listening.getsockname()[1]})
    warn_of_old_sqlite()
    settings.data_dir.mkdir(parents=True, exist_ok=True)
    engine = create_store_engine(settings.store_url, busy_timeout_ms=settings.busy_timeout_ms)
    migrate(engine)
    engine.dispose()
    # uvicorn raises the signal again when it is done; this turns it into an orderly end.
    signal.signal(signal.SIGTERM, _exit)
    with _worker_beside(settings, wanted=worker):
        _run(settings, listening)


def api_process() -> FastAPI:
    """What each of several API processes runs; it ends with the process that started it."""
    settings = Settings.from_environment(os.environ)
    configure_logs(settings.log_level)
    parent = os.getppid()
    threading.Thread(target=_end_with, args=(parent,), name="parent-watch", daemon=True).start()
    return create_app(settings)


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PARENT_CHECK_S)
    os._exit(0)  # a killed parent cannot ask; nothing is held that a crash would lose


def _exit(_number: int, _frame: FrameType | None) -> None:
    sys.exit(0)


def _listen(settings: Settings) -> socket.socket:
    """A bound socket; bound before anything else happens, so that a taken port leaves no trace."""
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((settings.host, settings.port))
    except OSError as error:
        listening.close()
        typer.echo(
            f"cannot listen on {settings.host} port {settings.port}: {error.strerror}.\n"
            "Choose another with --port; --port 0 takes any free one.",
            err=True,
        )
        raise typer.Exit(1) from None
    listening.set_inheritable(True)
    return listening


@contextmanager
def _worker_beside(settings: Settings, *, wanted: bool) -> Iterator[None]:
    handle = WorkerHandle(settings, WORKER) if wanted else None
    try:
        yield
    finally:
        if handle is not None:
            handle.stop()


def _run(settings: Settings, listening: socket.socket) -> None:
    if settings.web_processes == 1:
        AnnouncingServer(_config(create_app(settings), settings), settings).run([listening])
        return
    shutil.rmtree(settings.metrics_dir, ignore_errors=True)  # counters of processes long gone
    settings.metrics_dir.mkdir(parents=True)
    # Children are new interpreters: they find their settings in the environment.
    os.environ.update(settings.to_environment(), PROMETHEUS_MULTIPROC_DIR=str(settings.metrics_dir))
    _announce(settings)
    config = _config("app.commands.serve:api_process", settings)
    Multiprocess(config, sockets=[listening]).run()


def _config(app: FastAPI | str, settings: Settings) -> uvicorn.Config:
    return uvicorn.Config(
        app,
        factory=isinstance(app, str),
        workers=settings.web_processes,
        loop="uvloop",
        http="httptools",  # h11 would double the cost of every answer
        ws="none",
        log_config=None,
        access_log=False,  # a tenth of the throughput; /metrics counts requests
        server_header=False,
        timeout_graceful_shutdown=GRACE_S,
    )


class AnnouncingServer(uvicorn.Server):
    """A server that says where it is once it can be reached."""

    def __init__(self, config: uvicorn.Config, settings: Settings) -> None:
        super().__init__(config)
        self._settings = settings

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start as any server, then announce."""
        await super().startup(sockets)
        if self.started:
            _announce(self._settings)


def _announce(settings: Settings) -> None:
    host = f"[{settings.host}]" if ":" in settings.host else settings.host
    address = f"http://{host}:{settings.port}"
    typer.echo(f"roadprint serves {settings.data_dir} at {address}")
    typer.echo(f"interface: {address}/docs   ready: {address}/readyz   end: Ctrl-C")
    sys.stdout.flush()
