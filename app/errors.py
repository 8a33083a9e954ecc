"""
The tree of errors.

Errors carry the numbers a person needs to mend the fault and know nothing of HTTP: `app.api.errors`
holds the one table that gives each type its status.
"""

from __future__ import annotations

from dataclasses import dataclass, field


class RoadprintError(Exception):
    """Root of everything roadprint raises on purpose."""

    code = "error"
    title = "roadprint could not do this"


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing wrong with an input: where (a JSON pointer) and what (with the number)."""

    pointer: str
    detail: str


@dataclass(eq=False)
class InvalidInput(RoadprintError):
    """The input's shape or values are wrong; every fault names its place."""

    faults: list[Fault] = field(default_factory=list)
    code = "invalid-input"
    title = "The input is malformed"

    def __str__(self) -> str:
        return "; ".join(f"{fault.pointer or '/'}: {fault.detail}" for fault in self.faults)


class NotFound(RoadprintError):
    """A named thing does not exist."""

    code = "not-found"
    title = "There is no such thing"

    def __init__(self, noun: str, name: object) -> None:
        super().__init__(f"no {noun} {name!r}")
        self.noun = noun
        self.name = name


class Conflict(RoadprintError):
    """The request contradicts what is stored."""

    code = "conflict"
    title = "The request contradicts what is stored"


class DuplicateSurvey(Conflict):
    """The very same survey is stored already."""

    code = "duplicate-survey"
    title = "This survey is stored already"

    def __init__(self, survey_id: str) -> None:
        super().__init__(f"the same samples are stored as survey {survey_id}")
        self.survey_id = survey_id


class IdempotencyMismatch(Conflict):
    """An idempotency key came back with another body."""

    code = "idempotency-mismatch"
    title = "The idempotency key was used with another body"

    def __init__(self, key: str, survey_id: str) -> None:
        super().__init__(f"key {key!r} belongs to survey {survey_id}, whose content differs")
        self.key = key
        self.survey_id = survey_id


class NothingToBuild(Conflict):
    """A build was asked for and there is no road to build."""

    code = "nothing-to-build"
    title = "There is nothing to build"

    def __init__(self) -> None:
        super().__init__("no road has surveys or a model")


class NoMap(RoadprintError):
    """No map version is active yet."""

    code = "no-map"
    title = "There is no map yet"

    def __init__(self) -> None:
        super().__init__("no map version is active: post surveys and wait for their build")


class CannotBuildRoad(RoadprintError):
    """One road has no model; the reason is the message. Other roads are not touched by it."""

    code = "cannot-build-road"
    title = "The road cannot be built"


class NotEnoughSamples(CannotBuildRoad):
    """Too few samples to say anything of a road."""

    code = "not-enough-samples"

    def __init__(self, needed: int, got: int) -> None:
        super().__init__(f"{got} samples lie on the road, {needed} are needed")
        self.needed = needed
        self.got = got


class RoadTooShort(CannotBuildRoad):
    """The surveyed stretch is shorter than one sub-segment."""

    code = "road-too-short"

    def __init__(self, needed_m: float, got_m: float) -> None:
        super().__init__(f"the surveyed stretch is {got_m:.1f} m long, {needed_m:.1f} m are needed")
        self.needed_m = needed_m
        self.got_m = got_m


class NoCells(CannotBuildRoad):
    """No cell was heard often enough for a curve."""

    code = "no-cells"

    def __init__(self, heard: int, needed_samples: int) -> None:
        super().__init__(
            f"none of the {heard} cells was heard in {needed_samples} samples along the road"
        )
        self.heard = heard
        self.needed_samples = needed_samples
