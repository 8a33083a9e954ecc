"""
Why a window was answered as it was: the answer beside the best place that it was not.

Everything here is worked out anew from the window, the map and the fix, when somebody asks. A fix
that a track has moved is explained by what its window says by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from app.domain import FEATURE_KINDS, Direction, Fix, Window
from app.numerics import native
from app.numerics.contributions import Contributions, Place, contributions
from app.numerics.elsewhere import log_evidence, or_featureless
from app.numerics.expected import Expected, expected
from app.numerics.features import feature_matrix
from app.numerics.geodesy import Floats
from app.numerics.heeded import WildReading, left_out, silence_of
from app.numerics.index import MapIndex
from app.numerics.offmap import err_apart
from app.numerics.query import Query, ask
from app.numerics.rivals import answered_place, factor_beside, runner_up
from app.numerics.this_road import weigh

EXPECTED_FROM = 0.5  # a cell this probable at the answer's place, and never heard, is missing
VARIANCE, DIFFERENCE = FEATURE_KINDS.index("variance"), FEATURE_KINDS.index("mean_difference")


@dataclass(frozen=True, slots=True, eq=False)
class Account:
    """
    What the window says of one place.

    Attributes:
        came_by: Id of the road that the window was on before the corner; None without a corner.
        segment: Index of the sub-segment that holds the place.
        told: The place's score, taken apart.
        expected: What the map expects of the samples there, for the window's cells.
        silent_hearing: Mean probability of hearing each cell that the window did not hear at all.
        features: Those that the map predicts for the window there. Shape ``(5, cells)``.
        road_mask, segment_mask: Which of these are salient, same shape.
    """

    place: Place
    road_id: str
    came_by: str | None
    segment: int
    direction: Direction
    told: Contributions
    expected: Expected
    silent_hearing: dict[str, float]
    features: Float[np.ndarray, "kinds cells"]
    road_mask: Bool[np.ndarray, "kinds cells"]
    segment_mask: Bool[np.ndarray, "kinds cells"]

    @property
    def outside(self) -> float:
        """Share of the samples that would lie beyond the road's ends."""
        beyond = np.isnan(self.expected.hearing)
        return float(beyond.any(axis=1).mean()) if beyond.size else 0.0


@dataclass(frozen=True, slots=True)
class CellShare:
    """
    What one cell adds to the difference of the two scores, in nats; positive: for the answer.

    Attributes:
        level: By the levels it was read at; 0 for a cell that was not heard.
        hearing: By being heard or not.
    """

    cell: str
    level: float
    hearing: float

    @property
    def total(self) -> float:
        """Both together."""
        return self.level + self.hearing


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """
    A fix explained.

    Attributes:
        cells: Heard cells of the window that the map has, sorted; the columns of all matrices.
        behind_m: Travelled distance from each sample to the last one, oldest sample first.
        rsrp_dbm: The samples used, oldest first; NaN where not heard, or left out.
        answer, runner_up: The place that was answered, and the best one on another road, or of
            another sub-segment or direction where the map has no other road.
        shares: What each cell adds to the difference of the two scores, the largest first.
        offset: What other device offsets than the answer's add to it; negative where the runner-up
            would need one. Shares and offset add up to the difference.
        temperature: Scores are divided by it before they become probabilities; times ``noise``.
        features: The window's own. Shape ``(5, cells)``.
        fit: How well the window fits at the answer's place, nats a reading; None without cells.
        any_road: How probable its levels are on a road of which nothing is known, likewise.
        this_road: Log of how much more probable they are here than on others, what readings share
            counted (`app.numerics.this_road`); None without cells, and where samples err together.
        noise: How many times the surveys' variance readings have, expected; 1 where nobody knows.
        silence: For how much it counts that it lists no other cells (`app.numerics.listing`).
        left_out: Wild readings, oldest first; they are in nothing else here.
        unlisted: How many readings more are not, as the surveys' phones would not have listed them.
    """

    cells: tuple[str, ...]
    behind_m: Float[np.ndarray, " samples"]
    rsrp_dbm: Float[np.ndarray, "samples cells"]
    query: Query
    answer: Account
    runner_up: Account
    shares: tuple[CellShare, ...]
    offset: float
    temperature: float
    features: Float[np.ndarray, "kinds cells"]
    reference: str | None
    fit: float | None
    any_road: float | None
    this_road: float | None
    noise: float
    silence: float
    left_out: tuple[WildReading, ...]
    unlisted: int

    @property
    def difference(self) -> float:
        """By how much the answer's score is above the runner-up's, nats before the temperature."""
        return self.answer.told.score - self.runner_up.told.score

    @property
    def residual_db(self) -> Float[np.ndarray, "samples cells"]:
        """Readings minus what the answer's place has, device offset included; NaN without."""
        return self.residual_at(self.answer)

    def residual_at(self, account: Account) -> Float[np.ndarray, "samples cells"]:
        """The same at either place."""
        return self.rsrp_dbm - account.expected.rsrp_dbm - account.told.offset_db

    @property
    def missing(self) -> dict[str, float]:
        """Cells expected at the answer's place that were never heard: how probable each was."""
        hearing = self.answer.silent_hearing
        likely = sorted(hearing, key=lambda cell: (-hearing[cell], cell))
        return {cell: hearing[cell] for cell in likely if hearing[cell] >= EXPECTED_FROM}


def explain(index: MapIndex, window: Window, fix: Fix, *, in_c: bool = native.BUILT) -> Explanation:
    """
    Why a window was answered so.

    Args:
        fix: Of this window on this map.
        in_c: Search for the runner-up with the kernels in C, as the fix was.
    """
    query = ask(index, window, in_c=in_c)
    used = slice(len(window.distance_m) - query.samples, None)
    behind_m = window.distance_m[-1] - window.distance_m[used]
    rsrp_dbm = query.rsrp_dbm
    here = answered_place(index, query, fix)
    there = runner_up(index, query, here)
    road = index.roads[here.road]
    reference = road.cells[road.salient.reference]
    sight = _Sight(index, query, behind_m, rsrp_dbm, reference)
    answer = sight.account(here)
    rival = sight.account(there, answer.told.offset_db)  # it is one device, wherever it was
    this_road, noise = _judged(index, query, here)
    wild, unlisted = left_out(index, window, query)
    return Explanation(
        cells=query.cells,
        behind_m=behind_m,
        rsrp_dbm=rsrp_dbm,
        query=query,
        answer=answer,
        runner_up=rival,
        shares=_shares(query.cells, answer.told, rival.told),
        offset=answer.told.offset - rival.told.offset,
        temperature=query.temperature(index.calibration) * noise,
        features=sight.features(rsrp_dbm),
        reference=reference if reference in query.cells else None,
        fit=_fit(query, answer.told) if query.cells else None,
        any_road=or_featureless(log_evidence(query.fine)) / max(query.readings, 1e-6)
        if query.cells
        else None,
        this_road=this_road,
        noise=noise,
        silence=silence_of(query),
        left_out=wild,
        unlisted=unlisted,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Sight:
    """A window as it is held against one place after the other."""

    index: MapIndex
    query: Query
    behind_m: Float[np.ndarray, " samples"]
    rsrp_dbm: Float[np.ndarray, "samples cells"]
    reference: str

    def account(self, place: Place, offsets_db: Floats | None = None) -> Account:
        road, cells = self.index.roads[place.road], self.query.cells
        told = contributions(self.index, self.query, place, offsets_db)
        there = expected(self.index, place, cells, self.behind_m)
        segment = int(road.edges_m[1:-1].searchsorted(place.chainage_m, side="right"))
        silent = tuple(told.silent)
        hearing = expected(self.index, place, silent, self.behind_m).hearing
        return Account(
            place=place,
            road_id=road.road_id,
            came_by=None if place.way is None else self.index.road_ids[place.way.legs[-1].road],
            segment=segment,
            direction=Direction.FORWARD if place.sign > 0 else Direction.BACKWARD,
            told=told,
            expected=there,
            silent_hearing=dict(zip(silent, _means(hearing), strict=True)),
            features=self._predicted(there, told.offset_db),
            road_mask=_mask_of(road.salient.road, road.cells, cells),
            segment_mask=_mask_of(road.salient.segment(segment), road.cells, cells),
        )

    def features(self, rsrp_dbm: Float[np.ndarray, "samples cells"]) -> Float[np.ndarray, "k c"]:
        """Of readings at the window's samples; no mean difference without the reference cell."""
        cells = self.query.cells
        if not cells:
            return np.zeros((len(FEATURE_KINDS), 0))
        found = self.reference in cells
        column = cells.index(self.reference) if found else 0
        out = feature_matrix(rsrp_dbm, -self.behind_m, column)
        if not found:
            out[DIFFERENCE] = np.nan
        return out

    def _predicted(self, there: Expected, offset_db: Floats) -> Float[np.ndarray, "kinds cells"]:
        """What this device would have had: levels on the curves where it heard, and their noise."""
        heard = ~np.isnan(self.rsrp_dbm) & ~np.isnan(there.rsrp_dbm)
        out = self.features(np.where(heard, there.rsrp_dbm + offset_db, np.nan))
        noise_db2 = np.where(heard, there.spread_db, 0.0) ** 2
        out[VARIANCE] += noise_db2.sum(axis=0) / np.maximum(heard.sum(axis=0), 1)
        return out


def _means(hearing: Float[np.ndarray, "samples cells"]) -> list[float]:
    """Beyond the road's ends nothing is heard."""
    means: list[float] = np.nan_to_num(hearing).mean(axis=0).tolist()
    return means


def _mask_of(
    mask: Bool[np.ndarray, "kinds own"], own: tuple[str, ...], cells: tuple[str, ...]
) -> Bool[np.ndarray, "kinds cells"]:
    """A road's mask for the window's cells; those that the road lacks are not salient."""
    out = np.zeros((len(FEATURE_KINDS), len(cells)), dtype=bool)
    for at, cell in enumerate(cells):
        if cell in own:
            out[:, at] = mask[:, own.index(cell)]
    return out


def _shares(
    cells: tuple[str, ...], answer: Contributions, rival: Contributions
) -> tuple[CellShare, ...]:
    level = (answer.level.sum(axis=0) - rival.level.sum(axis=0)).tolist()
    hearing = (answer.hearing.sum(axis=0) - rival.hearing.sum(axis=0)).tolist()
    heard = [CellShare(*each) for each in zip(cells, level, hearing, strict=True)]
    silent = [
        CellShare(cell, 0.0, answer.silent.get(cell, 0.0) - rival.silent.get(cell, 0.0))
        for cell in answer.silent.keys() | rival.silent.keys()
    ]
    return tuple(sorted([*heard, *silent], key=lambda one: (-abs(one.total), one.cell)))


def _fit(query: Query, told: Contributions) -> float:
    """`app.numerics.offmap.Fit.per_reading` at the place."""
    free = 0.5 * told.residual**2 / max(told.weight, 1e-6)
    return (told.score - told.gain + free) / max(query.readings, 1e-6)


def _judged(index: MapIndex, query: Query, place: Place) -> tuple[float | None, float]:
    """`app.numerics.this_road` at the place, distances as they fit best: the factor and noise."""
    if not (query.cells and err_apart(index.calibration)):
        return None, 1.0
    road, prior = index.roads[place.road], query.prior(index)
    factor = factor_beside(index, query, place)
    return weigh(query, road, place.sign, place.chainage_m, prior, factor).judged()
