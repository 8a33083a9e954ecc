"""Bodies in: counted as sent, unpacked when gzipped, counted again as unpacked."""

from __future__ import annotations

import asyncio
import zlib
from collections.abc import Iterator

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.errors import Refusal

GZIP_WINDOW_BITS = 31  # zlib: a gzip header and the largest window
UNPACK_STEP_BYTES = 256 * 1024  # about a millisecond of the event loop


def body_too_large(limit_bytes: int) -> Refusal:
    """413 with the limit in force."""
    return Refusal(413, "body-too-large", f"the body is larger than {limit_bytes} bytes")


def bad_gzip(reason: str) -> Refusal:
    """400 for a body that says gzip and is not."""
    return Refusal(400, "bad-gzip", f"the gzip body {reason}")


class BodyLimit:
    """
    Refuses bodies beyond ``max_body_bytes`` and hands gzip bodies on unpacked.

    A plain body of announced length passes untouched: the server holds it to that length.
    """

    def __init__(self, app: ASGIApp, max_body_bytes: int) -> None:
        self.app = app
        self.max_body_bytes = max_body_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        announced = headers.get(b"content-length", b"")
        length = int(announced) if announced.isdigit() else None
        encoding = headers.get(b"content-encoding", b"identity").strip().lower()
        if length is not None and length > self.max_body_bytes:
            receive = _refusing(body_too_large(self.max_body_bytes))
        elif encoding in {b"gzip", b"x-gzip"}:
            receive = GzipReceive(receive, self.max_body_bytes)
        elif encoding != b"identity":
            receive = _refusing(_unknown_encoding(encoding))
        elif length is None:
            receive = CountingReceive(receive, self.max_body_bytes)
        await self.app(scope, receive, send)


def _unknown_encoding(encoding: bytes) -> Refusal:
    detail = f"content encoding {encoding.decode('latin-1')[:40]!r}; send gzip or none"
    return Refusal(415, "unsupported-encoding", detail, {"Accept-Encoding": "gzip"})


def _refusing(refusal: Refusal) -> Receive:
    async def receive() -> Message:
        raise refusal

    return receive


class CountingReceive:
    """A receive channel that counts what streams in without an announced length."""

    def __init__(self, receive: Receive, max_body_bytes: int) -> None:
        self._receive = receive
        self._max_body_bytes = max_body_bytes
        self._received_bytes = 0

    async def __call__(self) -> Message:
        """The next message.

        Raises:
            Refusal: More arrived than is allowed.
        """
        message = await self._receive()
        self._received_bytes += len(message.get("body", b""))
        if self._received_bytes > self._max_body_bytes:
            raise body_too_large(self._max_body_bytes)
        return message


class GzipReceive:
    """A receive channel that unpacks gzip in steps small enough to share the event loop."""

    def __init__(self, receive: Receive, max_body_bytes: int) -> None:
        self._receive = CountingReceive(receive, max_body_bytes)
        self._max_body_bytes = max_body_bytes
        self._unpacked_bytes = 0
        self._unpacker = zlib.decompressobj(GZIP_WINDOW_BITS)
        self._steps: Iterator[bytes] = iter(())
        self._last_arrived = False
        self._closed = False

    async def __call__(self) -> Message:
        """The next message, its body unpacked.

        Raises:
            Refusal: Too large once unpacked, not gzip, or cut short.
        """
        if self._closed:
            return await self._receive()
        while True:
            step = self._next_step()
            if step:
                await asyncio.sleep(0)
                return {"type": "http.request", "body": step, "more_body": True}
            if self._last_arrived:
                return self._finish()
            message = await self._receive()
            if message["type"] != "http.request":
                return message
            self._last_arrived = not message.get("more_body", False)
            self._steps = self._unpack(message.get("body", b""))

    def _next_step(self) -> bytes:
        try:
            step = next(self._steps, b"")
        except zlib.error:
            raise bad_gzip("is corrupt") from None
        self._unpacked_bytes += len(step)
        if self._unpacked_bytes > self._max_body_bytes:
            raise body_too_large(self._max_body_bytes)
        return step

    def _unpack(self, packed: bytes) -> Iterator[bytes]:
        while packed:
            if self._unpacker.eof:  # gzip members may follow one another (RFC 1952, section 2.2)
                self._unpacker = zlib.decompressobj(GZIP_WINDOW_BITS)
            step = self._unpacker.decompress(packed, UNPACK_STEP_BYTES)
            packed = self._unpacker.unconsumed_tail or self._unpacker.unused_data
            if step:
                yield step

    def _finish(self) -> Message:
        self._closed = True
        if not self._unpacker.eof:
            raise bad_gzip("ends early")
        return {"type": "http.request", "body": b"", "more_body": False}
