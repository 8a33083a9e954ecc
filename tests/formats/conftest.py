"""Reading a text as if it were a file."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import NamedTuple

import pytest

from app.formats.account import Account
from app.formats.assemble import Drive
from app.formats.options import Options
from app.formats.read import read_drives
from app.formats.sniff import sniff


class Read(NamedTuple):
    """What a file turned out to be."""

    name: str
    drives: list[Drive]
    account: Account


def read_text(
    text: str | bytes,
    options: Options = Options(),  # noqa: B008 - frozen
    *,
    wanted: str | None = None,
    keep_going: bool = False,
) -> Read:
    source = io.BytesIO(text.encode() if isinstance(text, str) else text)
    sniffed = sniff(source, wanted)
    account = Account()
    drives = list(read_drives(source, sniffed, options, account, keep_going=keep_going))
    return Read(sniffed.name, drives, account)


@pytest.fixture(scope="session")
def read() -> Callable[..., Read]:
    """`read_text`."""
    return read_text
