"""A simulated city's drives as a data set: what a survey team and test drivers would hand in."""

from __future__ import annotations

from collections.abc import Iterator

from app.domain import Direction, Trace
from app.evaluation.dataset import PassEntry, Role
from app.evaluation.scenario import City, drive, survey


def city_passes(city: City) -> Iterator[tuple[PassEntry, Trace]]:
    """The survey's passes, then a test drive both ways over every road."""
    for number, trace in enumerate(survey(city)):
        turn = number % city.scenario.survey_passes
        backward = city.scenario.both_directions and turn % 2 == 1
        direction = Direction.BACKWARD if backward else Direction.FORWARD
        yield _entry(f"survey-{number:05}", trace, direction, f"survey-{turn}"), trace
    for truth in city.roads:
        for direction in Direction:
            trace = drive(city, truth.road_id, direction)
            name = f"drive-{truth.road_id}-{direction}"
            yield _entry(name, trace, direction, "drive-0"), trace


def _entry(pass_id: str, trace: Trace, direction: Direction, session: str) -> PassEntry:
    role: Role = "survey" if session.startswith("survey") else "test"
    return PassEntry(pass_id, trace.road_id or "", role, direction, session)
