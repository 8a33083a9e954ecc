"""Files as bytes that can seek, unpacked when they are gzipped."""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

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


class _Unpacked(gzip.GzipFile):
    """A gzip whose damage is ours to report."""

    def __init__(self, file: BinaryIO) -> None:
        super().__init__(fileobj=file, mode="rb")

    def readinto(self, buffer: object) -> int:
        """The next bytes.

        Raises:
            BrokenFile: The gzip is corrupt or ends early.
        """
        try:
            return int(super().readinto(buffer))  # type: ignore[arg-type]
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            raise BrokenFile(f"the gzip is broken: {error}") from error
