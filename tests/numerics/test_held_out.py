"""Which windows a road holds out, and which of them have a say."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from app.domain import Trace
from app.evaluation.scenario import build_city, preset, survey
from app.numerics import fitting
from app.numerics.calibration import UNTRIED, calibrate
from app.numerics.curves import fit_curves
from app.numerics.evidence_table import DRAWN, DRAWN_BLINDLY, pack, shared_of, unpack
from app.numerics.heldout import Surface, held_out_evidence
from app.numerics.independence import (
    ALONE,
    CHANCES_SDS,
    FEWEST_PAIRS,
    NOT_SEEN,
    Shared,
    pooled,
    shared_about,
    shared_part,
)
from app.numerics.passes import RoadPass
from app.numerics.roadfit import fit_road
from app.numerics.unseen import held_out_windows
from tests.numerics.cities import city_of, models_of


def passes_of(name: str = "paper", cells: int = 6) -> tuple[list[Trace], ...]:
    """The survey of every road of a city."""
    city = city_of(name, cells)
    every = survey(city)
    return tuple([one for one in every if one.road_id == truth.road_id] for truth in city.roads)


def jolted(trace: Trace, seed: int, spread_db: float = 2.0) -> Trace:
    """The pass with an error that all cells of a sample share, as behind lorries."""
    common = np.random.default_rng(seed).normal(0.0, spread_db, len(trace.time_s))
    rsrp_dbm = (trace.rsrp_dbm + common[:, None]).astype(np.float32)
    return replace(trace, rsrp_dbm=rsrp_dbm)


def fitted(roads: tuple[list[Trace], ...]):
    """Their models, on the city's lines."""
    pairs = zip(city_of().roads, roads, strict=True)
    return [fit_road(truth.road, passes) for truth, passes in pairs]


@pytest.mark.parametrize("shared", [0.0, 0.2, 0.5, 0.9])
def test_the_shared_part_is_found(shared):
    """Cells that have a part of their variance in common, a fifth of the readings missing."""
    rng = np.random.default_rng(3)
    common, own = rng.normal(size=(2000, 1)), rng.normal(size=(2000, 5))
    residual = np.sqrt(shared) * common + np.sqrt(1.0 - shared) * own
    residual[rng.random(residual.shape) < 0.2] = np.nan
    found = shared_part(residual)
    assert found.part == pytest.approx(shared, abs=0.03)
    assert found.pairs > 50.0**2
    assert found.may_be_chance(1.0) == (shared == 0.0)


def test_too_few_pairs_tell_nothing():
    """Phones that report one cell a sample, or a handful of samples."""
    rng = np.random.default_rng(3)
    serving = np.full((500, 4), np.nan)
    serving[np.arange(500), rng.integers(0, 4, 500)] = rng.normal(size=500)
    assert shared_part(serving) == Shared(0.0, 0.0)
    assert shared_part(np.full((3, 2), np.nan)) == Shared(0.0, 0.0)
    assert not shared_part(serving).may_be_chance(9.0)
    assert not shared_part(rng.normal(size=(int(FEWEST_PAIRS) - 1, 2))).may_be_chance(9.0)
    assert shared_part(rng.normal(size=(int(FEWEST_PAIRS), 2))).may_be_chance(9.0)


def test_roads_tell_together_what_none_of_them_can():
    """Their products are summed as if all samples were of one road; single cells say nothing."""
    rng = np.random.default_rng(5)
    common, own = rng.normal(size=(480, 1)), rng.normal(size=(480, 2))
    for shared, apart in ((0.0, True), (0.4, False)):
        residual = np.sqrt(shared) * common + np.sqrt(1.0 - shared) * own
        roads = [shared_part(residual[first : first + 60]) for first in range(0, 480, 60)]
        together = pooled([*roads, ALONE])
        assert together.pairs == 480.0
        assert together.part == pytest.approx(shared_part(residual).part, abs=0.02)
        assert together.may_be_chance(2.0) == apart
        assert {one.may_be_chance(2.0) for one in roads} == ({True} if apart else {True, False})
    assert pooled([ALONE, ALONE]).may_be_chance(0.0)
    assert not pooled([]).may_be_chance(2.0)


def test_one_pass_draws_windows_only_where_readings_err_apart():
    """Of independent noise windows are drawn; where samples err as one they would be too easy."""
    apart = fitted(passes_of())
    assert all(len(unpack(model.evidence)) > 20 for model in apart)
    assert {one.fold for model in apart for one in unpack(model.evidence)} == {DRAWN}
    as_one = fitted(tuple([jolted(one, 5) for one in passes] for passes in passes_of()))
    assert not any(unpack(model.evidence) for model in as_one)
    assert calibrate(as_one) == UNTRIED


def test_few_passes_that_err_as_a_whole_know_too_little(monkeypatch):
    """Their spread is wider by 4 dB^2 of variance for one pass, by an eighth of it for two."""
    truth, one = city_of().roads[0], passes_of()[0][0]
    for passes in ([jolted(one, 5)], [jolted(one, 5), jolted(one, 6)]):
        wide = fit_road(truth.road, passes).spread_db
        with monkeypatch.context() as patched:
            patched.setattr(fitting, "ANOTHER_DAY_DB2", 0.0)
            own = fit_road(truth.road, passes).spread_db
        known = ~np.isnan(own)
        more_db2 = wide[known] ** 2 - own[known] ** 2
        np.testing.assert_allclose(more_db2, 4.0 / len(passes) ** 3, rtol=1e-3)


def test_levels_that_never_move_err_apart():
    """Cells without any noise, as made-up surveys have them, are no division by zero."""
    flat = np.full((201, 2), -90.0)
    still = RoadPass(np.arange(201.0), flat, np.ones_like(flat), "day")
    curves = fit_curves(still.chainage_m, flat, np.arange(201.0), 1.0)
    assert shared_about([still], curves, 1.0).may_be_chance(CHANCES_SDS)


def test_one_pass_is_held_back_and_many_may_follow_the_field():
    """Three times the likeliest strength for one pass, towards a quarter of it for many."""
    flat = np.full((201, 2), -90.0)
    one = RoadPass(np.arange(201.0), flat, np.ones_like(flat), "day")
    work = fitting.Fitting(200.0, 1.0, np.zeros(2, dtype=np.intp))
    told = [work.strength([one] * many, 2.0, apart=False) for many in (1, 2, 10)]
    assert told == pytest.approx([6.0, 2.0 * (0.25 + 2.75 / 4), 2.0 * (0.25 + 2.75 / 100)])
    assert work.strength([one], 2.0, apart=True) == 2.0


def test_serving_cells_alone_draw_none():
    """One reading a sample: nobody can tell, and the map is not taken at its word."""

    def serving(trace: Trace) -> Trace:
        strongest = np.nanmax(trace.rsrp_dbm, axis=1, keepdims=True)
        rsrp_dbm = np.where(trace.rsrp_dbm == strongest, trace.rsrp_dbm, np.nan)
        rsrp_dbm[np.cumsum(~np.isnan(rsrp_dbm), axis=1) > 1] = np.nan
        return replace(trace, rsrp_dbm=rsrp_dbm)

    models = fitted(tuple([serving(one) for one in passes] for passes in passes_of()))
    assert not any(unpack(model.evidence) for model in models)


def test_passes_of_one_day_are_held_out_one_by_one():
    """Of three passes within an hour each is asked of the other two; of other days, day by day."""
    first = passes_of("harsh")[0]
    same = [
        replace(one, recorded_at=first[0].recorded_at + timedelta(minutes=10 * number))
        for number, one in enumerate(first)
    ]
    truth = city_of("harsh").roads[0]
    model = fit_road(truth.road, same)
    windows = unpack(model.evidence)
    assert {one.fold for one in windows} == {0, 1, 2}
    assert all(one.measured for one in windows)
    assert len(model.unseen) == 3
    assert len(fit_road(truth.road, [*same[:2], first[2]]).unseen) == 2


def of(model, windows, shared):
    """The model with that evidence."""
    return replace(model, evidence=pack(windows, shared))


def test_what_few_roads_drew_by_chance_has_no_say():
    """Drawn windows count while all roads' readings may err independently; driven ones always."""
    models = list(models_of())
    windows = unpack(models[0].evidence)
    apart, as_one = Shared(0.0, 50.0), Shared(0.25, 500.0)
    every = [of(models[0], windows, apart), *(of(one, [], as_one) for one in models[1:])]
    assert held_out_windows(every) == []
    driven = [replace(one, fold=0) for one in windows]
    assert len(held_out_windows([of(models[3], driven, None), *every])) == len(windows)
    one_of_chance = [of(one, windows, Shared(0.02, 200.0)) for one in models[:3]]
    one_of_chance.append(of(models[3], [], Shared(0.5, 50.0)))
    assert len(held_out_windows(one_of_chance)) == 3 * len(windows)


def test_what_the_readings_share_is_kept_with_the_windows():
    """Of a road with one pass, whether it drew windows or not; of older ones, that it drew some."""
    told = shared_of(models_of()[0].evidence)
    assert told is not None
    assert told.pairs > 1000
    assert told.may_be_chance(2.0)
    as_one = fit_road(city_of().roads[0].road, [jolted(passes_of()[0][0], 5)])
    told = shared_of(as_one.evidence)
    assert told is not None
    assert not told.may_be_chance(2.0)
    windows = unpack(models_of()[0].evidence)
    assert shared_of(pack(windows)) == NOT_SEEN
    assert shared_of(pack([replace(one, fold=1) for one in windows])) is None
    assert shared_of(pack([])) is None
    assert shared_of(pack([], ALONE)) == ALONE
    assert unpack(pack([], ALONE)) == []


def test_a_city_of_few_cells_knows_that_its_readings_err_independently():
    """One pass and two cells a road: two roads seem not to, by chance; the map is not misled."""
    scenario = replace(preset("harsh"), cells=2, survey_passes=1)
    city = build_city(scenario, 643)
    every = survey(city)
    models = [
        fit_road(truth.road, [one for one in every if one.road_id == truth.road_id])
        for truth in city.roads
    ]
    told = [shared_of(model.evidence) for model in models]
    assert sum(one is not None and not one.may_be_chance(CHANCES_SDS) for one in told) == 2
    assert calibrate(models).window_count > 100


def test_windows_drawn_by_older_code_tell_nothing():
    """It drew them whatever the readings were like."""
    windows = unpack(models_of()[0].evidence)
    assert unpack(pack([replace(one, fold=DRAWN_BLINDLY) for one in windows])) == []


@pytest.mark.parametrize("groups", [("monday", "tuesday"), ("monday",)])
@pytest.mark.parametrize(("length_m", "wanted"), [(900, 72), (4_000, 160)])
def test_a_long_road_holds_out_a_window_each_25_m(length_m, wanted, groups):
    """Of two days or of one pass: a route of kilometres may be all of a map."""
    chainage_m = np.arange(0.0, length_m + 1.0, 10.0)
    level_dbm = np.full((len(chainage_m), 1), -90.0)
    heard = np.ones_like(level_dbm)
    passes = [RoadPass(chainage_m, level_dbm, heard, group) for group in groups]
    surface = Surface(*(np.full((length_m + 1, 1), value) for value in (-90.0, 2.0, 0.9)))
    found = held_out_evidence(passes, ("a",), surface, lambda _: surface, 1.0, shared=ALONE)
    assert len(unpack(found.windows)) == pytest.approx(wanted, rel=0.05)
