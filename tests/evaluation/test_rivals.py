"""Known behaviour of each rival on streets whose answer is known by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.domain import Direction, Window
from app.evaluation.methods import METHODS, Estimate, Place, Previous, cfels, gift, paper, rwknn
from app.evaluation.methods.paper_map import GradientVariance, draw_atlas, features
from app.evaluation.methods.references import lay_references, recent_mean_dbm
from app.evaluation.methods.tuning import choose, split

SEED = 3


@pytest.fixture(scope="module")
def waves(lab):
    """Two streets that look different everywhere."""
    return lab.street("a", 0.0, lab.wave(1)), lab.street("b", 100.0, lab.wave(2))


def test_reference_points_hold_the_mean_of_their_passes(lab):
    """Two passes 4 dB apart give their middle, at every point."""
    low = lab.street("a", 0.0, lambda at: np.full((len(at), 1), -92.0))
    both = lab.survey(low)
    loud = replace(both.traces[0], rsrp_dbm=both.traces[0].rsrp_dbm + 4.0)
    points = lay_references(replace(both, traces=(both.traces[0], loud)))
    np.testing.assert_allclose(points.rsrp_dbm, -90.0)
    np.testing.assert_allclose(np.diff(points.chainage_m), 1.0)


def test_points_without_samples_are_drawn_between_their_neighbours(lab):
    """A survey every 4 m serves a grid of 2 m by straight lines."""
    ramp = lab.street("a", 0.0, lambda at: -100.0 + 0.1 * at[:, None])
    sparse = replace(lab.survey(ramp, grid_m=2.0), traces=(ramp.trace(4.0),))
    points = lay_references(sparse)
    np.testing.assert_allclose(points.rsrp_dbm[:, 0], -100.0 + 0.1 * points.chainage_m, atol=1e-4)


def test_the_recent_mean_looks_back_only():
    """Mean of the last metres; a gap counts for nothing."""
    levels = np.array([[0.0], [2.0], [np.nan], [6.0]])
    mean = recent_mean_dbm(levels, np.arange(4.0), 1.0)
    np.testing.assert_allclose(mean[:, 0], [0.0, 1.0, 2.0, 6.0])


def test_one_pass_is_split_by_turns_and_days_by_day(lab):
    """What parameters are chosen on is never what they were learnt from."""
    one = lab.survey(lab.street("a", 0.0, lab.wave(1)))
    train, held = split(one)
    assert len(train.traces[0].lon) + len(held[0].lon) == len(one.traces[0].lon)
    assert not set(train.traces[0].lon) & set(held[0].lon)


def test_rwknn_weighs_its_three_nearest_by_the_inverse_distance(lab):
    """On a ramp the three nearest points lie about the true one."""
    ramp = lab.street("a", 0.0, lambda at: -100.0 + 0.2 * at[:, None])
    model = rwknn.Rwknn(lay_references(lab.survey(ramp)), rwknn.Parameters(5.0, 0.0, np.inf))
    window = ramp.window(80.0, 80.3, 0.3)
    levels = -100.0 + 0.2 * np.array([79.0, 80.0, 81.0])
    weight = 1.0 / (np.abs(levels - window.rsrp_dbm[-1]) + 1e-3)
    expected_m = weight @ np.array([79.0, 80.0, 81.0]) / weight.sum()
    assert model.locate(window, None).chainage_m == pytest.approx(expected_m, abs=1e-3)


def test_rwknn_stays_within_reach_of_the_previous_fix(lab):
    """Of two places that sound alike the one that can be reached is taken."""
    mirror = lab.street("a", 0.0, lambda at: -90.0 - 0.1 * np.abs(at[:, None] - 100.0))
    model = rwknn.Rwknn(lay_references(lab.survey(mirror)), rwknn.Parameters(5.0, 0.0, np.inf))
    left = model.locate(mirror.window(88.0, 92.0), None)
    after_left = model.locate(mirror.window(60.0, 50.0), Previous(left, 42.0))
    right = Previous(replace(left, memory=replace(left.memory, x_m=145.0, chainage_m=145.0)), 15.0)
    after_right = model.locate(mirror.window(145.0, 150.0), right)
    assert after_left.chainage_m == pytest.approx(50.0, abs=3.0)
    assert after_right.chainage_m == pytest.approx(150.0, abs=3.0)


def test_gift_does_not_hear_a_common_offset(waves, lab):
    """Signs of changes are the same on every device: the method's whole point."""
    model = gift.fit(lab.survey(*waves), SEED)
    for start_m, end_m in ((40.0, 70.0), (160.0, 120.0)):
        window = waves[0].window(start_m, end_m)
        louder = replace(window, rsrp_dbm=window.rsrp_dbm + 8.0)
        assert model.locate(louder, None).chainage_m == pytest.approx(
            model.locate(window, None).chainage_m, abs=1e-9
        )


def test_gift_finds_place_and_direction_of_a_clean_window(waves, lab):
    """Without noise the particles end near the truth, on the right street, the right way."""
    model = gift.fit(lab.survey(*waves), SEED)
    for street, start_m, end_m in ((waves[0], 40.0, 90.0), (waves[1], 170.0, 120.0)):
        fix = model.locate(street.window(start_m, end_m), None)
        assert fix.road_id == street.road_id
        assert fix.direction is (Direction.FORWARD if end_m > start_m else Direction.BACKWARD)
        assert fix.chainage_m == pytest.approx(end_m, abs=6.0)


def test_gift_goes_on_with_its_particles(waves, lab):
    """A window too short to say anything is placed by what the drive said before."""
    model = gift.fit(lab.survey(*waves), SEED)
    before = model.locate(waves[0].window(40.0, 90.0), None)
    short = waves[0].window(94.0, 95.0)
    assert model.locate(short, Previous(before, 5.0)).chainage_m == pytest.approx(95.0, abs=8.0)


def test_cf_els_finds_the_place_when_level_tells_distance(lab):
    """Level linear in distance, two cells: the search ends within its step of the truth."""
    sites = {}
    for i, (x_m, y_m) in enumerate(((-50.0, 30.0), (250.0, -40.0))):
        place = lab.frame.to_lonlat(x_m, y_m)
        sites[f"cell-{i}"] = Place(float(place.lon), float(place.lat))
    xy = np.array([[-50.0, 30.0], [250.0, -40.0]])

    def levels(at):
        away = np.hypot(at[:, None] - xy[:, 0], xy[:, 1])
        return -60.0 - 0.2 * away

    street = lab.street("a", 0.0, levels)
    survey = lab.survey(street, sites=sites)
    for area_m in (50.0, np.inf):
        atlas = cfels.draw_atlas(survey, cfels.Parameters(area_m, 1, 0.0), cfels.STEP_M)
        model = cfels.CurveSearch(atlas, cfels.Parameters(area_m, 1, 0.0))
        for end_m in (33.37, 121.0, 180.52):
            fix = model.locate(street.window(end_m - 10.0, end_m), None)
            assert fix.chainage_m == pytest.approx(end_m, abs=cfels.STEP_M)


def test_cf_els_places_an_unknown_site_at_its_strongest_readings(lab):
    """Where nobody says where a cell stands, the survey does."""
    peak = lab.street("a", 0.0, lambda at: -60.0 - 0.3 * np.abs(at[:, None] - 140.0))
    points = lay_references(lab.survey(peak))
    assert cfels._sites(points, lab.survey(peak)).x_m[0] == pytest.approx(140.0, abs=1.0)


def test_paper_features_are_those_of_equation_3():
    """By hand, for two cells and three samples: the gradient telescopes to its end samples."""
    levels = np.array([[-80.0, -90.0], [-84.0, -90.0], [-82.0, -96.0]])
    found = features(levels, np.array([0.0, 1.0, 2.0]), 0)
    expected = [-1.0, -3.0, -82.0, -92.0, 8.0 / 3.0, 8.0, 0.0, -10.0, 4.0, 6.0]
    np.testing.assert_allclose(found, expected)


def test_paper_segments_at_a_change_of_gradient():
    """Equation 5 is least when the cut is where the slope changes."""
    gradient = np.concatenate([np.full((30, 1), 0.5), np.full((50, 1), -0.2)])
    cost = GradientVariance().fit(gradient)
    cuts = {at: cost.error(0, at) + cost.error(at, 80) for at in range(5, 75)}
    assert min(cuts, key=cuts.get) == 30


def test_paper_finds_a_sub_segment_from_its_own_readings(waves, lab):
    """A window that is exactly one sub-segment of the survey matches it with distance 0."""
    survey = lab.survey(*waves)
    atlas = draw_atlas(survey, 2.0, 0.0)
    model = paper.PaperModel(atlas, paper.Parameters(2.0, 0.0, False, 0.0))
    points = atlas.points
    right = 0
    for number in range(len(atlas.road)):
        road = int(atlas.road[number])
        at = points.chainage_m
        inside = (points.road == road) & (at >= atlas.start_m[number]) & (at < atlas.end_m[number])
        levels = points.rsrp_dbm[inside]
        window = Window(points.cells, np.arange(len(levels)) * 1.0, levels)
        fix = model.locate(window, None)
        same = fix.segment[0] == atlas.start_m[number]
        right += fix.road_id == points.road_ids[road] and same
        assert 0.0 < fix.posterior <= 1.0
    assert right >= 0.8 * len(atlas.road)


def test_paper_without_selection_compares_all_features(waves, lab):
    """The letter of Eq. 6: the largest gain is that of the full set, so W is the identity."""
    scale = draw_atlas(lab.survey(*waves), 2.0, 0.0).segments
    seen = scale.features[0] + 1.0
    assert scale.distance(seen, select=False)[0] == pytest.approx(np.sqrt(len(seen)))
    assert scale.distance(seen, select=True)[0] == pytest.approx(np.sqrt(scale.mask[0].sum()))


def test_passes_are_held_out_whole_where_a_road_has_several(lab):
    """Undated passes: the last of them, never every second sample."""
    street = lab.street("a", 0.0, lab.wave(1))
    one = lab.survey(street)
    six = replace(one, traces=tuple(street.trace() for _ in range(6)))
    train, held = split(six)
    assert [len(each.lon) for each in held] == [len(one.traces[0].lon)]
    assert len(train.traces) == 5
    assert held[0] is six.traces[-1]


def test_parameters_are_chosen_on_every_road_both_ways(lab):
    """Held-out windows cover all roads and directions, a few in a row of each drive."""
    streets = [lab.street(name, 80.0 * i, lab.wave(i)) for i, name in enumerate("abc")]
    survey = lab.survey(*streets)
    seen, remembered = set(), []

    class Watcher:
        def locate(self, window, previous):
            remembered.append(previous is not None)
            seen.add(tuple(np.round(window.rsrp_dbm[-1], 1)))
            return Estimate("a", 0.0, 11.5, 48.1)

    def fit(train, choice):
        return Watcher()

    assert choose((1, 2), fit, survey, 5) == 1
    assert sum(remembered) >= len(remembered) // 2  # two of three go on from the one before
    assert len(remembered) == 2 * 2 * 6 * 3  # choices, protocols, streets both ways, in a row
    assert len(seen) > 20


def test_paper_masks_keep_at_least_one_feature_of_every_stretch(waves, lab):
    """A road or sub-segment without a salient feature would match everything."""
    atlas = draw_atlas(lab.survey(*waves), 2.0, 0.0)
    assert atlas.roads.mask.any(axis=1).all()
    assert atlas.segments.mask.any(axis=1).all()


def test_every_method_has_a_name_of_its_own():
    """The table is what people type."""
    assert list(METHODS) == ["paper", "rwknn", "gift", "cf-els", "exhaustive", "roadprint"]
    assert all(method.name == name for name, method in METHODS.items())


def test_cf_els_charges_for_a_cell_that_a_street_does_not_hear(lab):
    """A street that knows one of two heard cells does not win by knowing little."""

    def deaf(at):
        return np.column_stack([-80.0 - 0.1 * at, np.full(len(at), np.nan)])

    def both(at):
        return np.column_stack([-80.0 - 0.1 * at, -110.0 + 0.1 * at])

    streets = lab.street("deaf", 0.0, deaf), lab.street("both", 60.0, both)
    parameters = cfels.Parameters(np.inf, 1, 0.0, 500.0)
    model = cfels.CurveSearch(cfels.draw_atlas(lab.survey(*streets), parameters, 0.5), parameters)
    for end_m in (50.0, 150.0):
        assert model.locate(streets[1].window(end_m - 20.0, end_m), None).road_id == "both"


def test_paper_does_not_prefer_a_street_that_shares_no_cell(lab):
    """What one side does not hear counts as faint, not as equal."""
    here, elsewhere = lab.street("here", 0.0, lab.wave(1)), lab.street("there", 60.0, lab.wave(2))
    strange = replace(elsewhere.trace(), cells=tuple(f"far-{i}" for i in range(4)))
    survey = lab.survey(here, elsewhere)
    survey = replace(survey, traces=(here.trace(), strange))
    model = paper.PaperModel(draw_atlas(survey, 2.0, 0.0), paper.Parameters(2.0, 0.0, True, 0.0))
    assert model.locate(here.window(0.0, 200.0), None).road_id == "here"
