"""Field types that several schemas share: strict, finite, and short enough to store."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated

from pydantic import AwareDatetime, ConfigDict, Field

# Strict: a number in quotes is a mistake of the sender, and guessing hides it. `NaN` and `Infinity`
# are no JSON, but most parsers let them pass.
STRICT = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, ser_json_inf_nan="null")

MAX_NAME_CHARACTERS = 200
NO_CONTROL_CHARACTERS = r"^[^\x00-\x1f\x7f]+$"
ROAD_ID_PATTERN = r"^[^\x00-\x20\x7f/]([^\x00-\x1f\x7f/]*[^\x00-\x20\x7f/])?$"

Name = Annotated[
    str, Field(min_length=1, max_length=MAX_NAME_CHARACTERS, pattern=NO_CONTROL_CHARACTERS)
]
CellId = Annotated[
    str,
    Field(min_length=1, max_length=128, examples=["850:293", "310-410-26385408"]),
]
# Beyond these a clock was never set, and databases and time zones begin to overflow.
Moment = Annotated[
    AwareDatetime,
    Field(ge=datetime(1990, 1, 1, tzinfo=UTC), lt=datetime(2100, 1, 1, tzinfo=UTC)),
]
Id = Annotated[str, Field(max_length=MAX_NAME_CHARACTERS, pattern=NO_CONTROL_CHARACTERS)]
RoadId = Annotated[
    str,
    Field(
        min_length=1,
        max_length=128,
        pattern=ROAD_ID_PATTERN,
        description="Opaque; no slash and no control character, because it stands in paths.",
        examples=["street-07"],
    ),
]
# Fail fast: a list of a million wrong numbers has one thing to say.
Numbers = Annotated[list[float], Field(fail_fast=True)]
CellIds = Annotated[list[CellId], Field(fail_fast=True)]
Rows = Annotated[
    list[Annotated[list[float | None], Field(fail_fast=True)]],
    Field(
        fail_fast=True,
        description="One row a sample, one number a cell, dBm; `null` = not heard.",
        examples=[[[-110.6, -106.9], [-109.7, None]]],
    ),
]
