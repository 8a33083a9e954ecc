"""Bodies: their size, their packing, their media type."""

from __future__ import annotations

import gzip
import json
import socket
from collections.abc import Iterator

import pytest

from tests.api.conftest import SMALL_LIMITS, Service, assert_problem, window_json

LIMIT_BYTES = SMALL_LIMITS["max_body_bytes"]
JSON = {"Content-Type": "application/json"}
GZIP = {**JSON, "Content-Encoding": "gzip"}
PLAIN = json.dumps(window_json()).encode()
PACKED = gzip.compress(PLAIN)

BODY_PATHS = ["/v1/locate", "/v1/locate/batch", "/v1/surveys", "/v1/builds"]


def chunks(body: bytes, size: int = 1000) -> Iterator[bytes]:
    """A body without an announced length."""
    yield from (body[start : start + size] for start in range(0, len(body), size))


@pytest.mark.parametrize("path", BODY_PATHS)
@pytest.mark.parametrize("way", ["announced", "streamed", "packed", "streamed and packed"])
def test_a_body_beyond_the_limit_is_refused(shared: Service, path: str, way: str):
    """413, whether the size is announced, streamed, or only seen once unpacked."""
    body = b" " * (LIMIT_BYTES + 1)
    headers = JSON
    if "packed" in way:
        body, headers = gzip.compress(body), GZIP
        assert len(body) < LIMIT_BYTES / 100
    content = chunks(body) if "streamed" in way else body
    answer = shared.client.post(path, content=content, headers=headers)
    document = assert_problem(answer, 413, "body-too-large")
    assert str(LIMIT_BYTES) in document["detail"]


def test_a_hundred_megabytes_are_refused_before_they_come(shared: Service):
    """The announced length alone is refused; the body need not be sent."""
    address = (shared.client.base_url.host, shared.client.base_url.port)
    head = "POST /v1/surveys HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n"
    with socket.create_connection(address, timeout=10) as connection:
        connection.sendall(f"{head}Content-Length: {100 * 2**20}\r\n\r\n".encode())
        assert connection.recv(4096).startswith(b"HTTP/1.1 413")


@pytest.mark.parametrize("path", BODY_PATHS[:3])
@pytest.mark.parametrize(
    ("body", "words"),
    [
        (PACKED[: len(PACKED) // 2], "ends early"),
        (PACKED[:-1], "ends early"),
        (b"", "ends early"),
        (b"no gzip at all", "corrupt"),
        (PACKED[:40] + b"\xff" * 40 + PACKED[80:], "corrupt"),
        (PACKED + b"trailing rubbish", "corrupt"),
    ],
)
def test_broken_gzip_is_refused(shared: Service, path: str, body: bytes, words: str):
    """400 says what is wrong with the packing."""
    answer = shared.client.post(path, content=body, headers=GZIP)
    assert words in assert_problem(answer, 400, "bad-gzip")["detail"]


@pytest.mark.parametrize("size", [1, 7, 10_000])
def test_packed_bodies_mean_what_plain_ones_mean(shared: Service, size: int):
    """However a gzip body is cut into chunks or members, the answer is that of the plain body."""
    plain = shared.client.post("/v1/locate", content=PLAIN, headers=JSON)
    assert plain.status_code == 200
    members = gzip.compress(PLAIN[:100]) + gzip.compress(PLAIN[100:])
    for body in (PACKED, members):
        packed = shared.client.post("/v1/locate", content=chunks(body, size), headers=GZIP)
        assert packed.json() == plain.json()
    streamed = shared.client.post("/v1/locate", content=chunks(PLAIN, size), headers=JSON)
    assert streamed.json() == plain.json()


@pytest.mark.parametrize("encoding", ["br", "deflate", "gzip, gzip"])
def test_other_packings_are_refused(shared: Service, encoding: str):
    """415 names the encoding and the one that is taken."""
    headers = {**JSON, "Content-Encoding": encoding}
    answer = shared.client.post("/v1/locate", content=PLAIN, headers=headers)
    assert_problem(answer, 415, "unsupported-encoding")
    assert answer.headers["accept-encoding"] == "gzip"


@pytest.mark.parametrize("method_and_path", [("POST", path) for path in BODY_PATHS]
                         + [("PUT", "/v1/maps/active"), ("PUT", "/v1/roads/north")])  # fmt: skip
@pytest.mark.parametrize(
    "media_type",
    ["text/plain", "application/x-www-form-urlencoded", "application/json; charset=utf-16", "json"],
)
def test_other_media_types_are_refused(
    shared: Service, method_and_path: tuple[str, str], media_type: str
):
    """415 names what came and what is taken."""
    headers = {"Content-Type": media_type}
    answer = shared.client.request(*method_and_path, content=PLAIN, headers=headers)
    assert_problem(answer, 415, "unsupported-media-type")


@pytest.mark.parametrize(
    "media_type",
    ["application/json", "APPLICATION/JSON; charset=UTF-8", "application/x+json", None],
)
def test_json_by_its_names_is_taken(shared: Service, media_type: str | None):
    """Letter case, a charset, a suffix or silence do not matter."""
    headers = {"Content-Type": media_type} if media_type else {}
    answer = shared.client.post("/v1/locate", content=PLAIN, headers=headers)
    assert answer.status_code == 200, answer.text
