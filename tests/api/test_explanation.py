"""Why a window was answered so, over HTTP."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from app.api.schemas.explanation import ExplanationDocument
from app.api.schemas.locate import FixDocument
from tests.api.conftest import Service, assert_problem, window_json


def fix_of(service: Service, **changed: Any) -> dict[str, Any]:
    answer = service.client.post("/v1/locate", json=window_json(**changed))
    assert answer.status_code == 200, answer.text
    FixDocument.model_validate_json(answer.content, strict=False, extra="forbid")
    return answer.json()


def test_an_explanation_is_added_and_changes_nothing_else(shared: Service):
    """The fix is the one without; only the member `explanation` is new, and only when asked."""
    plain = fix_of(shared)
    assert "explanation" not in plain
    assert fix_of(shared, explain=False) == plain
    told = fix_of(shared, explain=True)
    explanation = told.pop("explanation")
    assert told == plain
    ExplanationDocument.model_validate(explanation, strict=False, extra="forbid")


@pytest.mark.parametrize("seed", range(4))
def test_contributions_add_up_over_http(shared: Service, seed: int):
    """Cells and offset together are the difference of the two scores."""
    told = fix_of(shared, seed=seed, explain=True)["explanation"]
    total = sum(one["total"] for one in told["cells"]) + told["offset_contribution"]
    apart = told["answer"]["score"] - told["runner_up"]["score"]
    assert total == pytest.approx(apart, abs=1e-6)
    assert told["score_difference"] == pytest.approx(apart, abs=1e-9)
    assert told["answer"]["road_id"] != told["runner_up"]["road_id"]
    for one in told["cells"]:
        assert one["total"] == pytest.approx(one["level"] + one["hearing"], abs=1e-9)


def test_residuals_are_readings_minus_the_fit(shared: Service):
    """One row a sample, one column a cell; null exactly where nothing can be compared."""
    window = window_json()
    window["rsrp_dbm"][3][0] = None
    told = fix_of(shared, rsrp_dbm=window["rsrp_dbm"], explain=True)["explanation"]
    samples = told["samples"]
    column = [window["cells"].index(cell) for cell in samples["cells"]]
    readings = np.array(window["rsrp_dbm"], dtype=float)[:, column]
    residual, expected = (
        np.array(samples[name], dtype=float) for name in ("residual_db", "expected_dbm")
    )
    offset = np.array(samples["offset_db"])
    np.testing.assert_allclose(residual, readings - expected - offset, atol=1e-6)
    assert np.ptp(offset) > 0.0  # the cells are of several carriers
    assert samples["residual_db"][3][samples["cells"].index(window["cells"][0])] is None
    assert samples["behind_m"] == [2.5 * back for back in range(11, -1, -1)]
    assert set(told["features"]) == {
        "mean_gradient",
        "mean",
        "variance",
        "mean_difference",
        "range",
    }


def test_every_window_of_a_batch_may_be_explained(shared: Service):
    """Each by its own wish; a bad one has its problem, and spoils none."""
    windows = [window_json(explain=True), window_json(), window_json(explain="yes")]
    answer = shared.client.post("/v1/locate/batch", json={"windows": windows})
    explained, plain, bad = answer.json()["fixes"]
    assert explained.pop("explanation")["words"]
    assert explained == plain
    assert bad["code"] == "invalid-input"
    assert bad["errors"][0]["pointer"] == "/windows/2/explain"


@pytest.mark.parametrize("wrong", ["true", 1, None, {}])
def test_explain_is_true_or_false(shared: Service, wrong: Any):
    """Anything else is refused where it stands."""
    answer = shared.client.post("/v1/locate", json=window_json(explain=wrong))
    assert_problem(answer, 422, "invalid-input", {"/explain"})


def test_a_window_of_unknown_cells_is_explained(shared: Service):
    """Off the map, and said why: there is nothing to compare."""
    told = fix_of(shared, cells=["x", "y", "z"], explain=True)
    assert told["status"] == "off_map"
    assert told["position"] is None
    assert "None of the window's cells" in told["explanation"]["words"][0]
    assert told["explanation"]["samples"]["cells"] == []
    assert told["explanation"]["fit"] is None
    assert told["explanation"]["any_road"] is None
    assert told["explanation"]["this_road"] is None


def test_a_tracked_fix_is_explained_by_its_window(shared: Service):
    """With a state, too; what the windows before say is not in the numbers, and they add up."""
    first = fix_of(shared, state=None, explain=True)
    way_m = [27.5 + 2.5 * step for step in range(12)]
    second = fix_of(shared, state=first["state"], distance_m=way_m, seed=2, explain=True)
    told = second["explanation"]
    total = sum(one["total"] for one in told["cells"]) + told["offset_contribution"]
    assert total == pytest.approx(told["score_difference"], abs=1e-6)


def test_a_single_sample_is_explained(shared: Service):
    """One sample has no gradient: nulls, not a failure."""
    told = fix_of(shared, samples=1, explain=True)["explanation"]
    assert set(told["features"]["mean_gradient"]["window"]) == {None}
    assert told["words"]
