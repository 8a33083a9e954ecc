"""Files as bytes that can seek, unpacked when they are gzipped."""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, cast

from app.formats.account import BrokenFile

GZIP_BEGINS = b"\x1f\x8b"
BUFFER_BYTES = 1 << 20


@contextmanager
def open_source(path: Path) -> Iterator[tuple[BinaryIO, BinaryIO]]:
    """The unpacked bytes, and the file itself, whose position tells how far the reading is."""
    with path.open("rb") as file:
        packed = file.read(2) == GZIP_BEGINS
        file.seek(0)
        if not packed:
            yield file, file
            return
        with io.BufferedReader(cast("io.RawIOBase", _Unpacked(file)), BUFFER_BYTES) as unpacked:
            yield cast("BinaryIO", unpacked), file


def damage_of(source: BinaryIO) -> BrokenFile | None:
    """Why a source ended before its end, once it has; None when it is whole."""
    return getattr(getattr(source, "raw", None), "damage", None)


class _Unpacked(gzip.GzipFile):
    """A gzip that ends where it is broken, so that what came before can be read to its last row."""

    def __init__(self, file: BinaryIO) -> None:
        super().__init__(fileobj=file, mode="rb")
        self.damage: BrokenFile | None = None

    def readinto(self, buffer: Any) -> int:
        """The next bytes; none after a break."""
        try:
            some = self.read1(len(buffer))  # not read: that loses what came before a break
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            self.damage = BrokenFile(f"the gzip is broken: {error}")
            return 0
        buffer[: len(some)] = some
        return len(some)
