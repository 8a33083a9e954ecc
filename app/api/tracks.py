"""From a request to a tracked window: what makes it one, and how its way is told."""

from __future__ import annotations

import numpy as np

from app.api.schemas.locate import LocateRequest
from app.domain import Window
from app.errors import Fault, InvalidInput
from app.numerics.index import MapIndex
from app.services.track import TrackedFix, Way, locate_tracked


def is_tracked(request: LocateRequest) -> bool:
    """Whether the request names `state`, be it null, or anything that only goes with it."""
    return "state" in request.model_fields_set or request.travelled_m is not None


def track(index: MapIndex, request: LocateRequest, window: Window, key: bytes) -> TrackedFix:
    """
    The fix of a tracked window, and its state.

    Raises:
        InvalidInput: ``travelled_m`` stands without a ``state``, or the state is none of ours.
    """
    if "state" not in request.model_fields_set:
        detail = "travelled_m tells the way since an earlier window, but no state comes with it"
        raise InvalidInput([Fault("/travelled_m", detail)])
    return locate_tracked(index, window, _way(request), request.state, key, request.confidence)


def _way(request: LocateRequest) -> Way:
    if request.distance_m is not None:
        return Way("m", np.array(request.distance_m), travelled_m=request.travelled_m)
    speed_mps = np.atleast_1d(np.asarray(request.speed_mps, dtype=np.float64))
    time_s = np.array(request.time_s, dtype=np.float64)
    return Way("s", time_s, float(speed_mps[0]), request.travelled_m)
