"""Why a window was answered so: what `"explain": true` adds to the answer."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field

Matrix = list[list[float | None]]


class ExplainedPlace(BaseModel):
    """A place held against the window."""

    road_id: str
    segment_index: int
    direction: Literal["forward", "backward"]
    chainage_m: float = Field(description="Of the window's last sample.")
    lon: float
    lat: float
    score: float = Field(description="Log likelihood against the background, nats.")
    samples_outside: float = Field(
        description="Share of the samples that would lie beyond the road's ends."
    )


class CellContribution(BaseModel):
    """
    What one cell adds to `score_difference`, nats; positive speaks for the answer.

    `residual_db` is the mean of readings minus expectation, the device offset taken out.
    """

    cell: str
    level: float = Field(description="By the levels it was read at.")
    hearing: float = Field(description="By being heard, or not.")
    total: float = Field(description="`level` + `hearing`.")
    heard: float = Field(description="Share of the samples that heard it.")
    answer_hearing: float = Field(description="Share that the map expects at the answer.")
    runner_up_hearing: float = Field(description="Share that the map expects at the runner-up.")
    answer_residual_db: float | None = Field(description="null: not heard or not mapped.")
    runner_up_residual_db: float | None = Field(description="null: not heard or not mapped.")


class ExplainedSamples(BaseModel):
    """
    Every sample used at the answer's place: one row a sample, oldest first, one column a cell.

    `residual_db` is the reading minus `expected_dbm` minus the cell's `offset_db`.
    """

    cells: list[str] = Field(description="The window's cells that the map has, sorted.")
    behind_m: list[float] = Field(description="Travelled distance from each sample to the last.")
    offset_db: list[float] = Field(
        description="Of the device and each cell's carrier, taken out of the levels at both places."
    )
    residual_db: Matrix = Field(description="null: not heard, or not mapped there.")
    expected_dbm: Matrix = Field(
        description="Level on the fitted curve, or, where the road lacks the cell, of the roads "
        "about it; null: not mapped there."
    )
    spread_db: Matrix = Field(description="Standard deviation of a new reading about it.")
    hearing: Matrix = Field(description="Probability of hearing the cell; null: beyond the road.")


class MissingCell(BaseModel):
    """A cell that is expected at the answer's place and was not heard at all."""

    cell: str
    hearing: float = Field(description="Mean probability of hearing it, a sample.")
    contribution: float = Field(description="Of its silence to the answer's score, nats.")


class LeftOutReading(BaseModel):
    """A reading that was left out of everything else."""

    cell: str
    behind_m: float = Field(description="Travelled distance from it to the last sample.")
    rsrp_dbm: float


class ExplainedFeature(BaseModel):
    """
    One kind of feature; one value a cell, in the order of `samples.cells`.

    Predicted values are those of the fitted curves at the samples that heard the cell, the device
    offset added; `variance` has the readings' spread in it, `range` is the curve's alone.
    """

    unit: str
    window: list[float | None]
    answer: list[float | None]
    runner_up: list[float | None]
    closer: list[Literal["answer", "runner_up"] | None] = Field(
        description="Whose prediction is nearer to the window's own; null: not comparable."
    )
    answer_road_mask: list[bool] = Field(description="Salient for the answer's road.")
    answer_segment_mask: list[bool] = Field(description="Salient for the answer's sub-segment.")
    runner_up_road_mask: list[bool]
    runner_up_segment_mask: list[bool]


class ExplanationDocument(BaseModel):
    """
    Which cells and features decided, the runner-up, and what separated it.

    `score_difference` = `answer.score` - `runner_up.score` = the sum of `cells[].total` +
    `offset_contribution`, in nats; divided by `temperature` it is the logarithm of how many times
    more probable the answer is, a metre. It is of this window alone: of a tracked fix, what the
    windows before say is not in it.
    """

    words: list[str] = Field(description="For people, most important first; English.")
    answer: ExplainedPlace = Field(description="The best place about the position.")
    runner_up: ExplainedPlace = Field(
        description="The best place on another road; of a map of one road, elsewhere on it."
    )
    score_difference: float
    temperature: float
    device_offset_db: float = Field(description="Of the device; carriers differ from it.")
    offset_contribution: float = Field(
        description="What other device offsets add; negative where the runner-up would need one."
    )
    cells: list[CellContribution] = Field(description="The largest `total` first.")
    fit: float | None = Field(
        description="How well it fits at the answer, nats a reading; tells on the map from off."
    )
    any_road: float | None = Field(
        description="How probable its levels are on a road of which nothing is known, nats a "
        "reading: of a window off the map hardly less than they are at the answer."
    )
    this_road: float | None = Field(
        description="Log of how much more probable its levels are at the answer than on other "
        "roads, what readings share counted, nats in all; null where samples err together."
    )
    noise: float = Field(
        description="How many times the surveys' variance readings may be expected to have: more "
        "of a noisy device, or where the area has drifted; 1 where samples err together. "
        "`temperature` has it in it."
    )
    silence: float = Field(
        description="For how much it counts that the window lists no other cells, 0 to 1: less "
        "where it lists fewer than the surveys did."
    )
    left_out: list[LeftOutReading] = Field(
        description="Wild readings, which the readings about them contradict; oldest first."
    )
    unlisted: int = Field(
        description="How many readings more are left out, as the surveys' phones would not have "
        "listed cells that weak."
    )
    samples: ExplainedSamples
    not_heard: list[MissingCell] = Field(description="The most probable first.")
    reference_cell: str | None = Field(
        description="That mean differences are from; null: the window has not heard it."
    )
    features: dict[str, ExplainedFeature] = Field(
        description="`mean_gradient`, `mean`, `variance`, `mean_difference`, `range`."
    )
