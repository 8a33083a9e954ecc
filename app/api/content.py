"""Media types: what a body claims to be, and what a client wants to see."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from email.message import Message as Header
from typing import Literal

from fastapi import Request

from app.api.errors import Refusal

JSON = "application/json"
CSV = "text/csv"
TEXT = "text/plain"
KML = "application/vnd.google-earth.kml+xml"
GEOJSON = "application/geo+json"
UTF8_NAMES = frozenset({"utf-8", "utf8", "us-ascii"})

Headers = Iterable[tuple[bytes, bytes]]


def body_media_type(headers: Headers, allowed: Sequence[str] = (JSON,)) -> str:
    """
    Which of the allowed media types a body claims to be; the first when it claims nothing.

    Raises:
        Refusal: It claims another type, or a character set other than UTF-8.
    """
    claimed = next((value for name, value in headers if name == b"content-type"), b"")
    if not claimed:
        return allowed[0]
    if claimed == b"application/json" and JSON in allowed:
        return JSON
    header = Header()
    header["content-type"] = claimed.decode("latin-1")
    media_type = header.get_content_type()
    if media_type.startswith("application/") and media_type.endswith("+json"):
        media_type = JSON
    if media_type not in allowed:
        wanted = " or ".join(allowed)
        detail = f"the body is {claimed.decode('latin-1')[:80]!r}; send {wanted}"
        raise Refusal(415, "unsupported-media-type", detail, {"Accept": ", ".join(allowed)})
    charset = str(header.get_content_charset("utf-8"))
    if charset not in UTF8_NAMES:
        raise Refusal(415, "unsupported-media-type", f"the body is in {charset!r}; send UTF-8")
    return media_type


async def require_json(request: Request) -> None:
    """A dependency of the routes with small JSON bodies."""
    body_media_type(request.scope["headers"])


async def raw_body(request: Request) -> bytes:
    """A dependency of the routes that parse their body themselves, away from the event loop."""
    return await request.body()


async def wants_geojson(request: Request) -> bool:
    """
    Whether a reader prefers GeoJSON to JSON; JSON when it has no preference.

    Raises:
        Refusal: It accepts neither.
    """
    quality = _qualities(request)
    return quality[GEOJSON] > quality[JSON]


async def prefers_json(request: Request) -> bool:
    """
    Whether a reader prefers JSON to GeoJSON, of what is GeoJSON by nature.

    Raises:
        Refusal: It accepts neither.
    """
    quality = _qualities(request)
    return quality[JSON] > quality[GEOJSON]


def _qualities(request: Request) -> dict[str, float]:
    accepted = request.headers.get("accept", "*/*")
    quality = {media_type: _quality(accepted, media_type) for media_type in (JSON, GEOJSON)}
    if max(quality.values()) <= 0:
        raise Refusal(
            406, "not-acceptable", f"accepts {accepted[:80]!r}; there is {JSON} and {GEOJSON}"
        )
    return quality


def _quality(accepted: str, media_type: str) -> float:
    """The weight of the most specific range that covers a media type (RFC 9110, section 12.5.1)."""
    best: tuple[int, float] = (-1, 0.0)
    for part in accepted.split(","):
        wanted, *parameters = (piece.strip().lower() for piece in part.split(";"))
        rank = _specificity(wanted, media_type)
        weights = [text[2:] for text in parameters if text.startswith("q=")]
        if rank > best[0]:
            best = (rank, _weight(weights[0]) if weights else 1.0)
    return best[1]


def _specificity(wanted: str, media_type: str) -> Literal[-1, 0, 1, 2]:
    if wanted == media_type:
        return 2
    if wanted == media_type.split("/", maxsplit=1)[0] + "/*":
        return 1
    return 0 if wanted == "*/*" else -1


def _weight(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0
