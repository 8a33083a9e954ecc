"""JSON documents out of a file, one at a time: an array, one a line, or one after another."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, BinaryIO

from app.formats.account import BrokenFile
from app.formats.table import Text

CHUNK_CHARACTERS = 1 << 18
SEPARATORS = " \t\r\n,\ufeff"
MOST_DOCUMENT_CHARACTERS = 1 << 25  # one document that is longer is no record


def each_document(source: BinaryIO) -> Iterator[tuple[int, Any]]:
    """
    The documents with their number from 1; those of an array one by one.

    Raises:
        BrokenFile: A document is broken or never ends; those before it have been given.
    """
    text = Text(source)
    decoder = json.JSONDecoder()
    waiting, number, array, ended = "", 0, None, False
    while True:
        waiting = waiting.lstrip(SEPARATORS)
        if array is None and waiting:
            array = waiting.startswith("[")
            waiting = waiting.removeprefix("[") if array else waiting
            continue
        if array and waiting.startswith("]"):
            return
        try:
            if not waiting:
                raise json.JSONDecodeError("no document", waiting, 0)
            document, end = decoder.raw_decode(waiting)
        except (json.JSONDecodeError, RecursionError) as error:
            if ended and not waiting and not array:
                return
            chunk = text.read(CHUNK_CHARACTERS)
            ended = not chunk
            if (ended and (waiting or array)) or len(waiting) > MOST_DOCUMENT_CHARACTERS:
                raise BrokenFile(f"record {number + 1}: no JSON: {error}") from error
            waiting += chunk
            continue
        number += 1
        waiting = waiting[end:]
        yield number, document
