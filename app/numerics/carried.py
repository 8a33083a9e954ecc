"""The readings that a track carries: what of a window is new, and all of them as one window."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.domain import Window


def unheard(window: Window, travelled_m: float) -> Window:
    """The samples of the last ``travelled_m``; the last sample alone when there is none."""
    since_m = window.distance_m[-1] - window.distance_m
    first = int((since_m < travelled_m).argmax()) if travelled_m > 0 else len(since_m) - 1
    if first == 0 and since_m[0] < travelled_m:
        return window
    first = first if since_m[first] < travelled_m else len(since_m) - 1
    way_m, rsrp_dbm = window.distance_m[first:], window.rsrp_dbm[first:]
    return Window(window.cells, way_m, rsrp_dbm, window.distance_error)


def joined(heard: Window, recent: Window, travelled_m: float) -> Window:
    """The readings before and the new ones, as one window that ends at 0."""
    cells = tuple(dict.fromkeys((*heard.cells, *recent.cells)))
    column = {cell: at for at, cell in enumerate(cells)}
    parts = []
    for one in (heard, recent):
        rsrp_dbm = np.full((len(one.distance_m), len(cells)), np.nan)
        rsrp_dbm[:, [column[cell] for cell in one.cells]] = one.rsrp_dbm
        parts.append(rsrp_dbm)
    before_m = heard.distance_m - heard.distance_m[-1] - travelled_m
    new_m = recent.distance_m - recent.distance_m[-1]
    way_m, rsrp_dbm = np.concatenate((before_m, new_m)), np.concatenate(parts)
    return Window(cells, way_m, rsrp_dbm, recent.distance_error)


def latest(window: Window, length_m: float) -> Window:
    """The samples of the last ``length_m``."""
    recent = window.distance_m >= window.distance_m[-1] - length_m
    return replace(window, distance_m=window.distance_m[recent], rsrp_dbm=window.rsrp_dbm[recent])
