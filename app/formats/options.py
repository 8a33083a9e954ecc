"""What the person who imports a file may say of it."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, tzinfo


@dataclass(frozen=True, slots=True)
class Options:
    """
    How a file is to be read.

    Attributes:
        zone: Of times that are written without one.
        device: Name of the device, over whatever the file says.
        fast: Whether Arrow may be loaded for large tables; a serving process must not.
    """

    zone: tzinfo = UTC
    device: str | None = None
    fast: bool = False
