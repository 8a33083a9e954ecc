"""
`POST /v1/locate` end to end beside its floor: a bare ASGI echo on the same uvicorn.

Both servers run as processes of their own; a connection to each asks in turn, in rounds, so that
what slows the machine slows both. The ratio is that of paired rounds. Ends by itself.

    python -m benchmarks.bench_http [--rounds 40] [--requests 100]
"""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import median, quantiles

import httpx
import numpy as np
import orjson
from starlette.types import Receive, Scope, Send

from app.domain import Window
from app.evaluation.scenario import build_city, preset, survey, windows
from app.numerics.calibration import calibrate
from app.numerics.roadfit import fit_road
from app.services import roadwork
from app.services.builds import get_build, request_build
from app.services.ingest import accept_survey
from app.settings import Settings
from app.store.engine import create_store_engine
from app.store.migrate import migrate

SEED = 7
WINDOW_M = 29.0  # 30 samples at 1 m
START_S = 30.0


async def echo(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers a body with itself."""
    if scope["type"] != "http":
        return
    message = await receive()
    body = message["body"]
    while message.get("more_body"):
        message = await receive()
        body += message["body"]
    headers = [(b"content-type", b"application/json"), (b"content-length", b"%d" % len(body))]
    await send({"type": "http.response.start", "status": 200, "headers": headers})
    await send({"type": "http.response.body", "body": body})


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument("--requests", type=int, default=100, help="of each kind in a round")
    chosen = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="roadprint-bench-") as folder:
        bodies = paper_area(Path(folder))
        with echo_server() as echo_url, roadprint_server(Path(folder)) as roadprint_url:
            report(measure(echo_url, roadprint_url, bodies, chosen.rounds, chosen.requests))


def paper_area(folder: Path) -> list[bytes]:
    """The paper's area as a published map in a data folder, and windows of 30 x 6 of it."""
    settings = Settings(data_dir=folder)
    engine = create_store_engine(settings.store_url)
    migrate(engine)
    city = build_city(preset("paper"), SEED)
    for trace in survey(city):
        accept_survey(engine, trace, build=False)
    build = request_build(engine, None)
    roads = roadwork.begin_build(engine, build.id)
    for road_id in roadwork.waiting_roads(engine, build.id, 0, roads):
        roadwork.build_road(engine, fit_road, build.id, road_id)
    roadwork.publish(engine, calibrate, build.id)
    if get_build(engine, build.id).status != "successful":
        raise RuntimeError("the benchmark's map was not built")
    engine.dispose()
    return [body_of(labelled.window) for labelled in windows(city, 100, length_m=WINDOW_M)]


def body_of(window: Window) -> bytes:
    """A locate request; NaN becomes null."""
    document = {
        "cells": window.cells,
        "distance_m": window.distance_m,
        "rsrp_dbm": np.ascontiguousarray(window.rsrp_dbm),
        "max_candidates": 5,
    }
    return orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY)


@contextmanager
def echo_server() -> Iterator[str]:
    """The floor: uvicorn with the settings that `roadprint serve` gives it."""
    port = free_port()
    command = [sys.executable, "-m", "uvicorn", "benchmarks.bench_http:echo", "--port", str(port)]
    options = ["--loop", "uvloop", "--http", "httptools", "--no-access-log", "--lifespan", "off"]
    with running([*command, *options, "--log-level", "warning"], f"http://127.0.0.1:{port}") as url:
        yield url


@contextmanager
def roadprint_server(folder: Path) -> Iterator[str]:
    """The product as a user starts it, but for the build worker, which would be idle."""
    port = free_port()
    command = [sys.executable, "-m", "app", "serve", "--data", str(folder), "--port", str(port)]
    with running([*command, "--no-worker"], f"http://127.0.0.1:{port}") as url:
        yield url


@contextmanager
def running(command: Sequence[str], url: str) -> Iterator[str]:
    """A server process from the moment it answers until the block ends."""
    root = Path(__file__).resolve().parents[1]
    process = subprocess.Popen(command, cwd=root, stdout=subprocess.DEVNULL, env=os.environ)
    try:
        deadline_s = time.monotonic() + START_S
        while True:
            try:
                httpx.post(f"{url}/readyz", content=b"{}")
            except httpx.TransportError:
                if process.poll() is not None or time.monotonic() > deadline_s:
                    raise
                time.sleep(0.05)
            else:
                break
        yield url
    finally:
        process.terminate()
        process.wait(10)


def free_port() -> int:
    """A port that nobody listens on now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Connection:
    """
    One kept-alive HTTP/1.1 connection on a bare socket.

    A client library costs more than the answers measured here.
    """

    def __init__(self, url: str, path: str) -> None:
        self._host = url.removeprefix("http://")
        self._path = path
        host, port = self._host.split(":")
        self._socket = socket.create_connection((host, int(port)))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def post(self, body: bytes) -> bytes:
        """The answer's body."""
        head = (
            f"POST {self._path} HTTP/1.1\r\nHost: {self._host}\r\n"
            f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
        )
        self._socket.sendall(head.encode() + body)
        received = self._socket.recv(65536)
        while b"\r\n\r\n" not in received:
            received += self._socket.recv(65536)
        answer_head, _, answer = received.partition(b"\r\n\r\n")
        if not answer_head.startswith(b"HTTP/1.1 200"):
            raise RuntimeError(received.decode())
        length = int(answer_head.lower().split(b"content-length:")[1].split(b"\r\n")[0])
        while len(answer) < length:
            answer += self._socket.recv(65536)
        return answer

    def close(self) -> None:
        """Hang up."""
        self._socket.close()


def measure(
    echo_url: str, roadprint_url: str, bodies: list[bytes], rounds: int, requests: int
) -> list[tuple[float, float]]:
    """Median of each round in seconds: echo, locate; a first round warms up and is left out."""
    connections = Connection(echo_url, "/"), Connection(roadprint_url, "/v1/locate")
    measured = []
    for _ in range(rounds + 1):
        echo_s, locate_s = (
            median(timed(connection, bodies[number % len(bodies)]) for number in range(requests))
            for connection in connections
        )
        measured.append((echo_s, locate_s))
    for connection in connections:
        connection.close()
    return measured[1:]


def timed(connection: Connection, body: bytes) -> float:
    """Seconds from the request's first byte to the answer's last."""
    started = time.perf_counter()
    connection.post(body)
    return time.perf_counter() - started


def report(measured: list[tuple[float, float]]) -> None:
    """Medians over the rounds with the range that half of the rounds lie in."""
    rows = {
        "bare ASGI echo": [1e6 * echo_s for echo_s, _ in measured],
        "POST /v1/locate": [1e6 * locate_s for _, locate_s in measured],
    }
    print(f"one connection, 30 x 6 windows, {len(measured)} interleaved rounds")
    for name, values in rows.items():
        print(f"{name:<16} {median(values):7.0f} us p50   half of the rounds {middle(values)}")
    ratios = [locate_s / echo_s for echo_s, locate_s in measured]
    print(f"{'ratio':<16} {median(ratios):7.2f}          half of the rounds {middle(ratios, 2)}")


def middle(values: list[float], digits: int = 0) -> str:
    """The quartiles."""
    low, _, high = quantiles(values, n=4)
    return f"{low:.{digits}f} to {high:.{digits}f}"


if __name__ == "__main__":
    main()
