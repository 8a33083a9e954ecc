"""
A track as its client keeps it: a short signed text that only this service can have made.

Laid out as little-endian numbers behind a format byte, the readings of a young track behind them,
signed with HMAC-SHA256, in URL-safe base64.
It is signed, not sealed: who has it can read where the vehicle may be, so it is to be kept like a
position. Roads stand by their ids and places by their coordinates too, so that a state outlives a
new map version.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.domain import Window
from app.errors import Fault, InvalidInput

FORMAT = 2
TAG_BYTES = 16
PURPOSE = b"roadprint state "
MAX_STATE_CHARACTERS = 65_536  # 64 modes on as many roads with the longest ids: some 46,000
MOST_HEARD_BYTES = 14_000  # of readings kept, packed; beside the modes, below the most characters
MOST_HEARD_SAMPLES = 10_000
CENTI = 100.0  # readings are kept as whole hundredths of a dB
NOT_HEARD = -32768
MICRO = 1e7  # degrees are kept as whole ten-millionths, some 1 cm

_HEAD = struct.Struct("<BIff")
_MARK = struct.Struct("<cddII")
_MODE = struct.Struct("<BbfffiiB")

ClockKind = Literal["m", "s", ""]


@dataclass(frozen=True, slots=True)
class Mark:
    """
    Where on the vehicle's own scale a window lay.

    Attributes:
        kind: Whether the window told its way by an odometer or by a clock, metres or seconds.
        first, last: Value at its first and last sample.
        first_print, last_print: Of what these samples heard, to know them again; 0 = nothing.
    """

    kind: ClockKind
    first: float
    last: float
    first_print: int
    last_print: int


@dataclass(frozen=True, slots=True)
class KeptMode:
    """A mode of the belief, by road id; see `app.numerics.belief.Mode`."""

    road_id: str
    sign: int
    chainage_m: float
    sd_m: float
    weight: float
    lon: float
    lat: float
    heading_deg: float


@dataclass(frozen=True, slots=True)
class KeptTrack:
    """All that one window of a track leaves to the next."""

    map_version: int
    anywhere: float
    off_map: float
    mark: Mark
    modes: tuple[KeptMode, ...]
    heard: Window | None = None


def seal(track: KeptTrack, key: bytes) -> str:
    """The state of a track."""
    payload = _packed(track)
    return base64.urlsafe_b64encode(payload + _tag(payload, key)).decode().rstrip("=")


def unseal(state: str, key: bytes) -> KeptTrack:
    """
    The track of a state.

    Raises:
        InvalidInput: At ``/state``: this service did not make it, or an older one did.
    """
    if len(state) > MAX_STATE_CHARACTERS:
        raise _refused(f"{len(state)} characters; {MAX_STATE_CHARACTERS} are the most")
    try:
        raw = base64.b64decode(state + "=" * (-len(state) % 4), altchars=b"-_", validate=True)
    except (binascii.Error, ValueError):
        raise _refused("this is no state: send back what the answer's `state` said") from None
    payload, tag = raw[:-TAG_BYTES], raw[-TAG_BYTES:]
    if not hmac.compare_digest(tag, _tag(payload, key)):
        raise _refused(
            "this service did not make this state, or it was changed on the way; "
            "begin a new track with null"
        )
    if payload[:1] != bytes([FORMAT]):
        raise _refused(f"the state has the older format {payload[0]}; begin a new track with null")
    return _unpacked(payload)


def _refused(detail: str) -> InvalidInput:
    return InvalidInput([Fault("/state", detail)])


def _tag(payload: bytes, key: bytes) -> bytes:
    return hmac.new(key, PURPOSE + payload, hashlib.sha256).digest()[:TAG_BYTES]


def _packed(track: KeptTrack) -> bytes:
    mark = track.mark
    road_ids = list(dict.fromkeys(mode.road_id for mode in track.modes))
    number = {road_id: i for i, road_id in enumerate(road_ids)}
    names = [road_id.encode() for road_id in road_ids]
    parts = [
        _HEAD.pack(FORMAT, track.map_version, track.anywhere, track.off_map),
        _MARK.pack(
            mark.kind.encode() or b" ", mark.first, mark.last, mark.first_print, mark.last_print
        ),
        bytes([len(names)]),
        *(struct.pack("<H", len(name)) + name for name in names),
        bytes([len(track.modes)]),
        *(
            _MODE.pack(
                number[mode.road_id],
                mode.sign,
                mode.chainage_m,
                mode.sd_m,
                mode.weight,
                round(mode.lon * MICRO),
                round(mode.lat * MICRO),
                round(mode.heading_deg / 360.0 * 256.0) % 256,
            )
            for mode in track.modes
        ),
        _packed_window(track.heard),
    ]
    return b"".join(parts)


def _packed_window(heard: Window | None) -> bytes:
    """Readings since the track began; nothing where there are none, or too many to carry."""
    if heard is None or len(heard.distance_m) > MOST_HEARD_SAMPLES:
        return b""
    names = [cell.encode() for cell in heard.cells]
    centi = np.where(np.isnan(heard.rsrp_dbm), NOT_HEARD / CENTI, heard.rsrp_dbm) * CENTI
    parts = [
        struct.pack("<HH", len(names), len(heard.distance_m)),
        *(struct.pack("<H", len(name)) + name for name in names),
        (heard.distance_m - heard.distance_m[-1]).astype("<f4").tobytes(),
        np.rint(centi).astype("<i2").tobytes(),
    ]
    packed = zlib.compress(b"".join(parts))
    return packed if len(packed) <= MOST_HEARD_BYTES else b""


def _unpacked_window(packed: bytes) -> Window | None:
    if not packed:
        return None
    raw = zlib.decompress(packed)
    cell_count, samples = struct.unpack_from("<HH", raw)
    at, cells = 4, []
    for _ in range(cell_count):
        (length,) = struct.unpack_from("<H", raw, at)
        cells.append(raw[at + 2 : at + 2 + length].decode())
        at += 2 + length
    distance_m = np.frombuffer(raw, "<f4", samples, at).astype(float)
    centi = np.frombuffer(raw, "<i2", samples * cell_count, at + 4 * samples)
    rsrp_dbm = np.where(centi == NOT_HEARD, np.nan, centi / CENTI).reshape(samples, cell_count)
    return Window(tuple(cells), distance_m, rsrp_dbm)


def _unpacked(payload: bytes) -> KeptTrack:
    _, map_version, anywhere, off_map = _HEAD.unpack_from(payload)
    kind, first, last, first_print, last_print = _MARK.unpack_from(payload, _HEAD.size)
    at = _HEAD.size + _MARK.size
    count, at = payload[at], at + 1
    road_ids = []
    for _ in range(count):
        (length,) = struct.unpack_from("<H", payload, at)
        road_ids.append(payload[at + 2 : at + 2 + length].decode())
        at += 2 + length
    end = at + 1 + payload[at] * _MODE.size
    modes = tuple(_modes(payload[at + 1 : end], road_ids))
    told: ClockKind = "m" if kind == b"m" else "s" if kind == b"s" else ""
    return KeptTrack(
        map_version,
        anywhere,
        off_map,
        Mark(told, first, last, first_print, last_print),
        modes,
        _unpacked_window(payload[end:]),
    )


def _modes(packed: bytes, road_ids: list[str]) -> Iterator[KeptMode]:
    for number, sign, chainage_m, sd_m, weight, lon, lat, heading in _MODE.iter_unpack(packed):
        yield KeptMode(
            road_ids[number],
            sign,
            chainage_m,
            sd_m,
            weight,
            lon / MICRO,
            lat / MICRO,
            heading / 256.0 * 360.0,
        )
