"""Cursors: opaque to clients, the last id of a page to us."""

from __future__ import annotations

import base64
import binascii

from app.errors import Fault, InvalidInput
from app.store.records import Page, T

MOST_ITEMS = 1000  # of one page


def after(cursor: str | None) -> str | None:
    """
    The id that a cursor stands for.

    Raises:
        InvalidInput: The cursor is none of ours.
    """
    if cursor is None:
        return None
    try:
        padded = cursor + "=" * (-len(cursor) % 4)
        found = base64.b64decode(padded, altchars=b"-_", validate=True).decode()
    except (binascii.Error, UnicodeDecodeError, ValueError):
        found = ""
    if not found or not found.isprintable():  # PostgreSQL takes no NUL in a text
        raise InvalidInput([Fault("/cursor", f"{cursor!r} is no cursor of this list")])
    return found


def bounded(limit: int) -> int:
    """
    The limit, refused outside 1..`MOST_ITEMS`.

    Raises:
        InvalidInput: It is outside.
    """
    if not 1 <= limit <= MOST_ITEMS:
        raise InvalidInput([Fault("/limit", f"limit is {limit}, it must be 1..{MOST_ITEMS}")])
    return limit


def sealed(page: Page[T]) -> Page[T]:
    """The page with its cursor made opaque."""
    if page.next_cursor is None:
        return page
    token = base64.urlsafe_b64encode(page.next_cursor.encode()).decode().rstrip("=")
    return Page(page.items, token)
