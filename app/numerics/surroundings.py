"""
Surroundings: what the roads about a place say of cells there.

A street that few passes know lacks cells that its neighbours have, and a cell that it heard once
may be heard always or hardly ever. Cells reach over streets, so the chance of hearing one moves
towards what is heard about the place, and a cell that is heard about it, but not mapped there, is
mapped with the level that it has there and a spread that says how little that is.

It depends on all roads of a map (as days do, `app.numerics.days`), so it is worked out when a map
is laid out, and no stored model remembers it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from app.domain import RoadModel, Salience
from app.numerics.carriers import NOTHING_KNOWN, carrier_of, carriers_of, numbers, unmapped_chance
from app.numerics.geodesy import Floats
from app.numerics.newcomers import Newcomers
from app.numerics.observation import HEARD_FLOOR, logit

STATION_M = 8.0  # between the places of a road that tell, and are told
REACH_M = 50.0  # what a place says of another falls by e over so many metres
FARTHEST_M = 200.0  # beyond, it says nothing
PULL = 0.7  # of the log odds of hearing a cell about a place, as they differ from the usual, count
USUAL = 0.12  # share of a carrier's samples that hear a cell of the map, where it is heard at all
DOUBT = 0.1  # one tenth of a station where things are as usual stands for what nobody knows
SURE = 0.01  # no closer than this to never, or to always
LEAST_HEARD = 0.03  # share about a place from which a cell is mapped there
CLOSE_M = 10.0  # places within so much of the nearest count alike for a level, and others less
AT_ONCE_DB = 4.0  # spread of another day's levels about those of places right beside
FARTHER_DB_M = 1.0 / 15.0  # by which it grows with the way to the nearest place that has the cell
FAR_DB = 8.0  # up to this much
SHARP_M = 5.0  # of many distances the least, to within a few metres


@dataclass(frozen=True, slots=True, eq=False)
class Stations:
    """
    What one road tells others, every `STATION_M`.

    Attributes:
        where_m: East and north, in a plane that all roads share. Shape ``(2, stations)``.
        heard: Chance of hearing each cell, 0 where it is not mapped. Shape ``(stations, cells)``.
        level_dbm: Expected level, 0 where it is not mapped, same shape.
        carriers: Of the cells, in the order in which they are first named.
        listened: Whether anybody listened to each carrier. Shape ``(stations, carriers)``.
    """

    where_m: Float[np.ndarray, "2 stations"]
    cells: tuple[str, ...]
    heard: Float32[np.ndarray, "stations cells"]
    level_dbm: Float32[np.ndarray, "stations cells"]
    carriers: tuple[str, ...]
    listened: Bool[np.ndarray, "stations carriers"]

    @classmethod
    def of(cls, model: RoadModel, where_m: Float[np.ndarray, "2 stations"]) -> Stations:
        """Of a road's model."""
        at = slice(None, None, _stride(model))
        mean_dbm, heard = model.mean_dbm[at], model.heard[at]
        mapped = ~np.isnan(mean_dbm)
        strange = unmapped_chance(heard, mean_dbm, numbers(model.cells), HEARD_FLOOR)
        return cls(
            where_m,
            model.cells,
            np.where(mapped, heard, np.float32(0.0)),
            np.where(mapped, mean_dbm, np.float32(0.0)),
            carriers_of(model.cells),
            strange < NOTHING_KNOWN,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Around:
    """
    What is heard about the stations of a road.

    Attributes:
        cells: The road's, then the others that are heard there often enough.
        pull: What it adds to the log odds of hearing each. Shape ``(stations, cells)``.
        level_dbm, spread_db: Of each about each station, NaN where it is not heard, same shape.
        often: Whether it is heard at least `LEAST_HEARD` there, same shape.
    """

    cells: tuple[str, ...]
    pull: Float[np.ndarray, "stations cells"]
    level_dbm: Float[np.ndarray, "stations cells"]
    spread_db: Float[np.ndarray, "stations cells"]
    often: Bool[np.ndarray, "stations cells"]


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """
    All roads of a map, as each is to others.

    Attributes:
        boxes_m: West, south, east and north of each.
        newcomers: To each the cells that its days say nothing of; nor does what is about it.
    """

    roads: tuple[Stations, ...]
    boxes_m: Float[np.ndarray, "roads 4"]
    newcomers: Newcomers

    @classmethod
    def of(
        cls,
        models: Sequence[RoadModel],
        where_m: Sequence[Float[np.ndarray, "2 _"]],
        newcomers: Newcomers,
    ) -> Surroundings:
        """
        From all models of a map.

        Args:
            where_m: Of each road's grid, in a plane that all roads share.
        """
        pairs = zip(models, where_m, strict=True)
        roads = tuple([Stations.of(model, xy[:, :: _stride(model)]) for model, xy in pairs])
        boxes_m = [np.concatenate((one.where_m.min(1), one.where_m.max(1))) for one in roads]
        return cls(roads, np.array(boxes_m).reshape(len(roads), 4), newcomers)

    def told(self, road: int, model: RoadModel) -> RoadModel:
        """
        A road's model that has heard what the surroundings say.

        Args:
            road: Its number.
            model: Of the road itself, which is a part of its surroundings; it need not be the one
                that the others are told of.
        """
        around = self._around(road, Stations.of(model, self.roads[road].where_m))
        size, own = model.mean_dbm.shape
        mapped = np.zeros((size, len(around.cells)), dtype=bool)
        mapped[:, :own] = ~np.isnan(model.mean_dbm)
        place = _Between.along(size, _stride(model))
        filled = around.often[place.nearest] & ~mapped
        mean_dbm, spread_db = np.full((2, *mapped.shape), np.nan)
        mean_dbm[:, :own], spread_db[:, :own] = model.mean_dbm, model.spread_db
        alone = _chance(model, around.cells)
        moved = 1.0 / (1.0 + np.exp(-logit(alone) - place.of(around.pull)))
        return _with_cells(
            model,
            around.cells,
            np.where(filled, place.of(around.level_dbm), mean_dbm).astype(np.float32),
            np.where(filled, place.of(around.spread_db), spread_db).astype(np.float32),
            np.where(filled | mapped, moved, alone).astype(np.float32),
        )

    def _around(self, road: int, own: Stations) -> Around:
        """What is heard about the stations of a road, its own further along included."""
        box_m = self.boxes_m[road] + FARTHEST_M * np.array([-1.0, -1.0, 1.0, 1.0])
        close = (self.boxes_m[:, :2] <= box_m[2:]).all(1) & (self.boxes_m[:, 2:] >= box_m[:2]).all(
            1
        )
        others = [self.roads[at] for at in np.flatnonzero(close).tolist() if at != road]
        strange = self.newcomers.cells_to(road)
        told_of = (cell for one in others for cell in one.cells if cell not in strange)
        cells = tuple(dict.fromkeys((*own.cells, *told_of)))
        sums = _Sums.of(own, [own, *others], cells)
        often = (sums.heard > LEAST_HEARD * sums.tried) & (sums.heard > 0.0)
        kept = np.flatnonzero((np.arange(len(cells)) < len(own.cells)) | often.any(axis=0))
        share = (sums.heard + DOUBT * USUAL) / (sums.tried + DOUBT)
        pull = PULL * (logit(np.clip(share, SURE, 1.0 - SURE)) - np.log(USUAL / (1.0 - USUAL)))
        with np.errstate(divide="ignore", invalid="ignore"):  # of cells that nobody hears there
            level_dbm = sums.told_dbm / sums.close
            nearest_m = np.maximum(-SHARP_M * np.log(sums.beside), 0.0)
        spread_db = np.minimum(AT_ONCE_DB + FARTHER_DB_M * nearest_m, FAR_DB)
        names = tuple([cells[at] for at in kept])
        return Around(names, pull[:, kept], level_dbm[:, kept], spread_db[:, kept], often[:, kept])


@dataclass(frozen=True, slots=True, eq=False)
class _Sums:
    """
    Over all stations about each of a road's, the nearer counting more. Shape ``(stations, cells)``.

    Attributes:
        heard, tried: Chances of hearing each cell, and as much where its carrier was listened to.
        told_dbm, close: Levels and chances, those `CLOSE_M` off counting half of those at once.
        beside: Stations that hear it, of which only the nearest is felt.
    """

    heard: Float[np.ndarray, "stations cells"]
    tried: Float[np.ndarray, "stations cells"]
    told_dbm: Float[np.ndarray, "stations cells"]
    close: Float[np.ndarray, "stations cells"]
    beside: Float[np.ndarray, "stations cells"]

    @classmethod
    def of(cls, own: Stations, every: Sequence[Stations], cells: tuple[str, ...]) -> _Sums:
        column = {cell: at for at, cell in enumerate(cells)}
        carrier = {name: at for at, name in enumerate(carriers_of(cells))}
        stations = own.where_m.shape[1]
        heard, told_dbm, close, beside = (np.zeros((stations, len(cells))) for _ in range(4))
        listened = np.zeros((stations, len(carrier)))
        for one in every:
            away_m = np.hypot(*(own.where_m[:, :, None] - one.where_m[:, None, :]))
            says = np.where(away_m < FARTHEST_M, np.exp(-away_m / REACH_M), 0.0)
            for name, by in zip(one.carriers, one.listened.T, strict=True):
                if name in carrier:
                    listened[:, carrier[name]] += says @ by
            known = [at for at, cell in enumerate(one.cells) if cell in column]
            at = [column[one.cells[each]] for each in known]
            chance = one.heard[:, known].astype(float)
            heard[:, at] += says @ chance
            says /= 1.0 + (away_m / CLOSE_M) ** 2
            close[:, at] += says @ chance
            told_dbm[:, at] += says @ (chance * one.level_dbm[:, known])
            beside[:, at] += np.exp(-away_m / SHARP_M) @ (chance > 0.0)
        tried = listened[:, [carrier[carrier_of(cell)] for cell in cells]]
        return cls(heard, tried, told_dbm, close, beside)


def _stride(model: RoadModel) -> int:
    """Grid steps between a road's stations."""
    return max(round(STATION_M / model.step_m), 1)


@dataclass(frozen=True, slots=True, eq=False)
class _Between:
    """Where a road's grid lies among its stations: the one before, the one after, the share."""

    low: Int[np.ndarray, " grid"]
    high: Int[np.ndarray, " grid"]
    share: Float[np.ndarray, " grid"]

    @classmethod
    def along(cls, size: int, stride: int) -> _Between:
        last = (size - 1) // stride
        low, past = np.divmod(np.arange(size), stride)
        return cls(low, np.minimum(low + 1, last), past / stride)

    @property
    def nearest(self) -> Int[np.ndarray, " grid"]:
        return np.where(self.share < 0.5, self.low, self.high)

    def of(self, stations: Float[np.ndarray, "stations cells"]) -> Float[np.ndarray, "grid cells"]:
        """Straight between stations; as the nearest where either has no value."""
        straight = stations[self.low] + self.share[:, None] * (
            stations[self.high] - stations[self.low]
        )
        return np.where(np.isnan(straight), stations[self.nearest], straight)


def _chance(model: RoadModel, cells: tuple[str, ...]) -> Float[np.ndarray, "grid cells"]:
    """Chance of hearing each cell as the road alone knows it; the first ones are its own."""
    carrier = numbers(model.cells)
    strange = unmapped_chance(model.heard, model.mean_dbm, carrier, HEARD_FLOOR)
    unknown = np.append(strange, np.full((len(strange), 1), NOTHING_KNOWN), axis=1)
    known = {name: at for at, name in enumerate(carriers_of(model.cells))}
    more = [known.get(carrier_of(cell), -1) for cell in cells[len(model.cells) :]]
    out = np.concatenate((model.heard.astype(float), unknown[:, more]), axis=1)
    return np.clip(out, HEARD_FLOOR, 1.0 - HEARD_FLOOR)


def _with_cells(
    model: RoadModel,
    cells: tuple[str, ...],
    mean_dbm: Float32[np.ndarray, "grid cells"],
    spread_db: Float32[np.ndarray, "grid cells"],
    heard: Float32[np.ndarray, "grid cells"],
) -> RoadModel:
    """The model with more cells, none of which is salient, nor was heard on any of its days."""
    more = len(cells) - len(model.cells)

    def wider(features: Floats) -> Floats:
        return np.pad(features, ((0, 0), (0, more)), constant_values=np.nan)

    def as_salient(salience: Salience) -> Salience:
        return replace(salience, mask=np.pad(salience.mask, ((0, 0), (0, more))))

    return replace(
        model,
        cells=cells,
        mean_dbm=mean_dbm,
        spread_db=spread_db,
        heard=heard,
        features=wider(model.features),
        salience=as_salient(model.salience),
        segments=tuple(
            replace(one, features=wider(one.features), salience=as_salient(one.salience))
            for one in model.segments
        ),
        heard_on={day: np.pad(on, (0, more)) for day, on in model.heard_on.items()},
    )
