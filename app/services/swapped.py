"""Longitude and latitude in each other's place, told by where all other drives and roads are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from sqlalchemy.engine import Connection, Engine

from app.domain import Trace
from app.errors import Fault, InvalidInput
from app.formats.swap import confirmed_by_country
from app.store.bounds import bounds_of, touches, widened
from app.store.engine import read
from app.store.places import anything_in
from app.store.records import Bounds

FAR_DEG = 1.35  # of latitude, some 150 km: nearer to something known, a drive is where it says
NEAR_DEG = 0.1  # some 11 km: a survey's town


class SwappedPlaces(InvalidInput):
    """A drive lies far from everything known, and its mirror image amidst it."""

    code = "swapped-places"
    title = "Longitude and latitude look swapped"

    def __init__(self, detail: str, drive: int = 0) -> None:
        super().__init__([Fault("/lon/0", detail)])
        self.detail = detail
        self.drive = drive


def refuse_swapped_drives(engine: Engine, traces: Sequence[Trace]) -> None:
    """
    `refuse_swapped` for the drives of one file, against each other, too; nothing is stored.

    Raises:
        SwappedPlaces: Of one of them, whose number it tells.
    """
    before: list[Bounds] = []
    with read(engine) as connection:
        for number, trace in enumerate(traces):
            try:
                refuse_swapped(connection, trace, before)
            except SwappedPlaces as error:
                raise SwappedPlaces(error.detail, number) from None
            before.append(bounds_of(trace.lon, trace.lat))


def refuse_swapped(connection: Connection, trace: Trace, before: Sequence[Bounds] = ()) -> None:
    """
    Refuse a drive whose positions make sense only with longitude and latitude exchanged.

    Far from every road and survey, with its mirror image in a town that is known: that happens to a
    correct drive only where somebody surveys two towns that mirror each other. Global ids of cells
    of the country where the drive says it is settle even that.

    Args:
        before: Boxes of the drives before it in the same file.

    Raises:
        SwappedPlaces: So it is.
    """
    lon, lat = trace.lon, trace.lat
    if np.any(np.abs(lon) > 90.0):
        return  # as a latitude it would be none
    around = widened(bounds_of(lon, lat), FAR_DEG)
    if any(touches(around, box) for box in before) or anything_in(connection, around):
        return
    mirrored = widened(bounds_of(lat, lon), NEAR_DEG)
    name = anything_in(connection, mirrored)
    if name is None and any(touches(mirrored, box) for box in before):
        name = "an earlier drive of the file"
    ids = [trace.global_ids.get(cell, cell) for cell in trace.cells]
    known = [each for each in ids if each.count("-") == 2]
    if name is None or confirmed_by_country(lon, lat, known):
        return
    raise SwappedPlaces(
        f"lon and lat look swapped: lon {lon[0]:g}, lat {lat[0]:g} is more than 150 km from every "
        f"road and survey that is known, and the other way round it is by {name}; exchange them, "
        "here or there"
    )
