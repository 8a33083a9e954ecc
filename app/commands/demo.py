"""`roadprint demo`: the whole of roadprint once, on the paper's area."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import orjson
import typer

from app.commands.client import HttpTarget
from app.commands.console import FAULT, conclude, err, follow_build, out, progress_bar, reported
from app.commands.scores import Answer, scores_table
from app.commands.target import survey_document, window_document
from app.evaluation.scenario import City, build_city, preset, survey, windows
from app.evaluation.truth import Labelled

DEFAULT_PORT = 8000
START_TIMEOUT_S = 60.0  # migrating and importing everything on a loaded machine
STOP_TIMEOUT_S = 15.0
WINDOW_FILE = "window.json"
LOG_FILE = "serve.log"
STORE_VARIABLE = "ROADPRINT_DATABASE_URL"


def demo(
    data: Annotated[
        Path,
        typer.Option("--data", metavar="DIR", help="Folder that the demo fills; emptied first."),
    ] = Path("demo-data"),
    seed: Annotated[int, typer.Option(min=0, help="Another seed is another city.")] = 1,
    window_count: Annotated[
        int, typer.Option("--windows", min=1, help="How many windows are located.")
    ] = 200,
    port: Annotated[
        int, typer.Option(help="Port of the demo's service; any free one when it is taken.")
    ] = DEFAULT_PORT,
) -> None:
    """
    Start a service on an empty folder, simulate the paper's area, survey it over HTTP, build the
    map, locate windows of fresh drives, and print how far off the answers were.

    The folder keeps the map: `make serve` serves it afterwards.
    """
    with reported():
        _empty(data)
        city = build_city(preset("paper"), seed)
        with _service(data, _free_port(port)) as service:
            survey_and_build(service, city)
            fresh = windows(city, window_count)
            answers = locate_all(service, fresh)
    out.print(scores_table(answers))
    _say_how_to_go_on(data, fresh[0])


def _empty(folder: Path) -> None:
    """
    Make the folder empty, if it is ours to empty.

    Raises:
        typer.Exit: It holds something that no demo left there.
    """
    if folder.exists() and any(folder.iterdir()) and not (folder / LOG_FILE).exists():
        err.print(f"{folder} is not empty and no demo's: choose another with --data")
        raise typer.Exit(FAULT)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)


def _free_port(wanted: int) -> int:
    """The port that is wanted, else one that is free."""
    for port in (wanted, 0):
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                out.print(f"port {port} is taken: the demo uses another")
            else:
                return int(probe.getsockname()[1])
    err.print("no port is free")
    raise typer.Exit(FAULT)


@contextmanager
def _service(data: Path, port: int) -> Iterator[HttpTarget]:
    """`roadprint serve` on the folder, as an operator would start it, until the block ends."""
    where = ("--host", "127.0.0.1", "--port", str(port))
    command = (sys.executable, "-m", "app", "serve", "--data", str(data), *where)
    # The demo is about its own folder, whatever store the environment names.
    environment = {name: value for name, value in os.environ.items() if name != STORE_VARIABLE}
    with (data / LOG_FILE).open("wb") as log:
        process = subprocess.Popen(  # noqa: S603 - our own program
            command, stdout=log, stderr=subprocess.STDOUT, env=environment
        )
        try:
            with HttpTarget(f"http://127.0.0.1:{port}") as service:
                _await_start(service, process, data)
                out.print(f"service at {service.url}, data in {data}")
                yield service
        finally:
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _await_start(service: HttpTarget, process: subprocess.Popen[bytes], data: Path) -> None:
    deadline_s = time.monotonic() + START_TIMEOUT_S
    while not service.is_ready():
        if process.poll() is not None or time.monotonic() > deadline_s:
            last = (data / LOG_FILE).read_text(errors="replace").splitlines()[-8:]
            err.print("the service did not start:\n  " + "\n  ".join(last), markup=False)
            raise typer.Exit(FAULT)
        time.sleep(0.1)


def survey_and_build(service: HttpTarget, city: City) -> None:
    """Post a city's roads and survey, and wait until the service serves the map of it."""
    for truth in city.roads:
        service.put_road(truth.road)
    traces = survey(city)
    with progress_bar("passes") as bar:
        for trace in bar.track(traces, description="surveying"):
            service.post_survey(survey_document(trace), None)
    build = follow_build(service, service.request_build(None))
    conclude(service, build)
    _await_map(service, build.map_version)


def _await_map(service: HttpTarget, version: int | None) -> None:
    """The build is done; the serving process takes its map up within its polling interval."""
    deadline_s = time.monotonic() + START_TIMEOUT_S
    while service.served_version() != version:
        if time.monotonic() > deadline_s:
            err.print("the service does not serve the map that was built")
            raise typer.Exit(FAULT)
        time.sleep(0.05)


def locate_all(service: HttpTarget, fresh: Sequence[Labelled]) -> list[Answer]:
    """Locate windows one after the other and compare each answer with its truth."""
    answers = []
    with progress_bar("windows") as bar:
        for window, truth in bar.track(fresh, description="locating"):
            document = window_document(window)
            started_s = time.perf_counter()
            response = service.locate_response(document)
            delay_ms = (time.perf_counter() - started_s) * 1000.0
            timing = response.headers.get("server-timing", "")
            answers.append(Answer.of(response.json(), truth, delay_ms, timing))
    return answers


def _say_how_to_go_on(data: Path, labelled: Labelled) -> None:
    window_file = data / WINDOW_FILE
    window_file.write_bytes(orjson.dumps(window_document(labelled.window)))
    make = "make serve" if data == Path("demo-data") else f"make serve DATA={data}"
    address = f"http://127.0.0.1:{DEFAULT_PORT}"
    lines = (
        f"the map stays in {data}; serve it:   {make}",
        f"then see it at                       {address}/docs",
        "and ask for a fix:",
        f"  curl -s {address}/v1/locate -H 'Content-Type: application/json' -d @{window_file}",
    )
    for line in lines:
        out.print(line, highlight=False, soft_wrap=True, markup=False)
