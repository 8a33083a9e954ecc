"""What the kernels in C are handed may be anything: it is refused, or does no harm."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.domain import Candidate, Direction
from app.numerics import native, posterior
from app.numerics.index import MapIndex
from app.numerics.matching import fine_places, shortlist
from app.numerics.query import Query, ask
from tests.numerics.test_native import SEEDS, a_window, built, index_of

KNOWN = ValueError, TypeError, BufferError, OverflowError


def arguments(seed: int) -> dict[str, list[object]]:
    """Valid arguments of every kernel."""
    window = a_window(seed)
    index = index_of(seed % 5)
    query = ask(index, window, in_c=True)
    places = fine_places(index, query, shortlist(index, query))
    tape, road, atlas = index.tapes[0], index.roads[1], index.atlas
    level = tape.levels[0]
    score = np.zeros(2 * len(level.positions), dtype=np.float32)
    rsrp_dbm, cells = np.ascontiguousarray(window.rsrp_dbm), len(window.cells)
    block = np.zeros(len(rsrp_dbm) * (2 + 3 * cells))
    channels = 1 + 2 * len(query.cells)  # each is a group of its own
    over_tape, over_road = (query.aimed(query.told, one.column) for one in (tape, road))
    room, finer = native.no_places(9), native.no_places(len(places) + 4 * 2)
    old, terms = (places.where, places.values), native.likelihood(index.offset_prior)
    return {
        "heard_columns": [rsrp_dbm],
        "evidence": [
            *(window.distance_m, rsrp_dbm, [*range(cells)], [0] * cells),
            *(1.0, -95.0, 10.0, block),
        ],
        "without_wild": [
            *(window.distance_m, rsrp_dbm, 2, 3, 40.0, 10.0, 4.5, np.empty(rsrp_dbm.shape)),
        ],
        "listen": [query.told.block, query.told.samples, np.ones(len(query.cells)), 0.2, 0.7, 0.1],
        "elsewhere": [
            query.told.block,
            query.told.samples,
            len(query.cells),
            64.0,
            36.0,
            40.0,
            9.0,
            1.9,
            1.0,
        ],
        "this_road": [
            *(*over_road, road.along.rows, 3, 0.4, -1, 1.0, 1.1, 1.4, 100.0, 9.0, 100.0, 36.0),
            *(20.0, 4.0, 3.0, 0.8, 100.0, 64.0, 20.0, 9.0, 1.9, terms),
        ],
        "tape": [
            *(
                *over_tape,
                level.blocks,
                level.outside,
                level.positions,
                4.0,
                terms,
                score,
            ),
            *(np.array([[30, 66], [1, -1], [1, 0]]), np.zeros((2, channels, 5), dtype=np.float32)),
        ],
        "turns": [
            *(np.ones((4, 3, 5), dtype=np.float32), *np.array([[0, 1], [2, 3], [5, 2]])),
            *(1, 4, terms, np.empty((2, 5), dtype=np.float32)),
        ],
        "joined": [*np.array([[0, 1, 1], [2, 0, 2]]), np.empty(3, dtype=np.int64)],
        "gains": [
            *(np.array([0, 1, 1]), np.array([[2, 0, 2], [0, 0, 1]]), np.array([0, 1, 0])),
            np.empty(2),
        ],
        "kept_by_mass": [score, 1.0, 1e-4, 50, np.empty(50, dtype=np.int64)],
        "heaviest": [score, 1.0, 1e-4, 5e-3, 50, np.empty(51, dtype=np.int64)],
        "rest": [
            *(score, np.array([0, 3, 9]), np.array([2, 4]), 1.0, 4.0, 0.0, 30.0, 1e-4),
            *(np.empty(3, dtype=np.int64), np.empty(3)),
        ],
        "stretch": [
            *(*over_road, road.along.rows, 1, -1, 3, 7, 1.0, 60.0, terms),
            *(room.where, room.values, 2),
        ],
        "rows": [*old, atlas.step_m, 7.0, 3, 3, 6],
        "redrawn": [*over_road, road.along.bend, *old, 0, 3, 5, 1.0, 1.0, *finer_of(finer)],
        "stretches_about": [*old, atlas.step_m, atlas.size, 1.0, 8.0, 100.0, 3.0, 400.0],
        "under_factors": [
            *(*over_road, [stretch_of(index, query, 1, 3, 7), stretch_of(index, query, 0, 2, 2)]),
            *(np.array([0.97, 1.03, 0.9, 1.1]), np.array([-2.0, -3.0, -4.0, -4.0]), 2.0),
            *(2, 2.0, terms),
            *(atlas.step_m, 7.0, 3, 3, 6, 5, *old, 4),
            np.zeros(2 * (len(places) + 99), dtype=np.int64),
            np.zeros(posterior.VALUES * (len(places) + 99)),
            np.zeros(99),
            np.zeros(99),
        ],
        "with_neighbours": [
            index.coarse_places[0].number,
            np.array([3, 7]),
            np.array([3, 7]),
            len(index.coarse_places[0].number),
            np.zeros(6, dtype=np.int64),
        ],
        "stretches_of_coarse": [
            *(np.array([2.0, 4.0, 30.0]), np.array([0, 0, 1]), np.array([1, 1, -1])),
            *(2.0, 5.0, atlas.step_m, atlas.size),
        ],
        "candidates": [
            *(Candidate, [(0, 1, -1, 0.5, 3.0, 8.0, 50.0)], index.road_ids),
            *(Direction.FORWARD, Direction.BACKWARD, 0.9),
        ],
        "summary": [
            *(*old, atlas.start, atlas.size, atlas.segment, atlas.step_m, atlas.plane),
            *(
                atlas.edge_m,
                atlas.first_edge,
                1.0,
                15.0,
                1e-3,
                0.68,
                1.0,
                3.0,
                4.0,
                1e-4,
                0.02,
                1e-9,
            ),
        ],
    }


def stretch_of(
    index: MapIndex, query: Query, number: int, first: int, last: int
) -> tuple[object, ...]:
    road = index.roads[number]
    along, cells = road.along, road.column.numbers(query.cells)
    where = (number, -1, first, last, road.step_m, road.length_m)
    return (along.rows, along.bend, cells, *where)


def finer_of(places: posterior.Places) -> tuple[object, object]:
    return places.where, places.values


def changed(value: object, how: int) -> object:
    """An argument spoilt in one of many ways."""
    if isinstance(value, np.ndarray):
        far, none = (np.inf, np.nan) if value.dtype.kind == "f" else (2**62, -1)
        ways = [
            *(value[:-1].copy(), value[:0].copy(), value[..., ::-1], value[..., None]),
            *(np.zeros(value.shape, dtype=np.float16), value.astype(">f8"), value.tolist(), None),
            *(np.full_like(value, 10**9), np.full_like(value, -(10**9)), np.zeros_like(value)),
            *(np.full_like(value, far), np.full_like(value, -far), np.full_like(value, none)),
        ]
    elif isinstance(value, list | tuple):
        ways = [value[:-1], [*value, 0], [10**9] * len(value), [-5], None, [], ["x"], [2**70]]
    else:
        ways = [-1, 0, 10**6, 10**15, -(2**62), 2**62, 2**70, np.nan, np.inf, -np.inf, None, "x"]
    return ways[how % len(ways)]


KERNELS = sorted(arguments(1)) if native.BUILT else ["none"]


@built
@settings(max_examples=300, deadline=None)
@given(
    SEEDS,
    st.sampled_from(KERNELS),
    st.integers(0, 18),
    st.integers(0, 155),
    st.none() | st.integers(0, 155),
)
def test_spoilt_arguments_are_refused_or_harmless(seed, which, place, how, also):
    """Whatever a kernel is given, it answers or raises; one or two arguments are spoilt here."""
    given_ = arguments(seed % 50)[which]
    for step, change in ((0, how), (3, also)):
        if change is not None:
            at = (place + step) % len(given_)
            with np.errstate(over="ignore"):
                given_[at] = changed(given_[at], change)
    kernel = getattr(native._native, which)
    try:
        kernel(*given_)
    except KNOWN:
        return


@built
@settings(max_examples=100, deadline=None)
@given(SEEDS, st.integers(0, 1), st.integers(0, 8), st.integers(0, 155))
def test_spoilt_stretches_are_refused_or_harmless(seed, which, place, how):
    """So are stretches of which one number or array is spoilt."""
    given_ = arguments(seed % 50)["under_factors"]
    spoilt = [list(one) for one in given_[4]]
    with np.errstate(over="ignore"):
        spoilt[which][place] = changed(spoilt[which][place], how)
    given_[4] = [tuple(one) for one in spoilt]
    try:
        native._native.under_factors(*given_)
    except KNOWN:
        return


@built
@pytest.mark.parametrize("which", KERNELS)
def test_valid_arguments_are_taken_and_their_number_counts(which):
    """The arguments that the test above spoils are right as they stand."""
    kernel, given_ = getattr(native._native, which), arguments(1)[which]
    kernel(*given_)
    for wrong in (given_[:-1], [*given_, 0]):
        with pytest.raises(TypeError, match="arguments needed"):
            kernel(*wrong)
