"""Looking at surveys, and forgetting them."""

from __future__ import annotations

from sqlalchemy.engine import Engine

from app.domain import Trace
from app.errors import NotFound
from app.services.builds import join_build
from app.services.paging import after, bounded, sealed
from app.store import drives, roads, surveys
from app.store.engine import read, write
from app.store.records import Page, SurveySummary

__all__ = ["Page", "SurveySummary", "delete_survey", "get_survey", "list_surveys", "survey_trace"]


def list_surveys(
    engine: Engine, *, road_id: str | None = None, limit: int = 100, cursor: str | None = None
) -> Page[SurveySummary]:
    """
    Surveys in the order of their arrival.

    Raises:
        NotFound: ``road_id`` names no road.
        InvalidInput: ``limit`` or ``cursor`` is wrong.
    """
    with read(engine) as connection:
        if road_id is not None and roads.missing_roads(connection, [road_id]):
            raise NotFound("road", road_id)
        page = surveys.select_page(
            connection, road_id=road_id, limit=bounded(limit), after=after(cursor)
        )
    return sealed(page)


def get_survey(engine: Engine, survey_id: str) -> SurveySummary:
    """
    One survey without its samples.

    Raises:
        NotFound: There is no such survey.
    """
    with read(engine) as connection:
        found = surveys.select_summary(connection, survey_id)
    if found is None:
        raise NotFound("survey", survey_id)
    return found


def survey_trace(engine: Engine, survey_id: str) -> Trace:
    """
    A survey's samples as they were posted.

    Raises:
        NotFound: There is no such survey.
    """
    with read(engine) as connection:
        found = surveys.select_trace(connection, survey_id)
    if found is None:
        raise NotFound("survey", survey_id)
    return found


def delete_survey(engine: Engine, survey_id: str, *, build: bool = True) -> str | None:
    """
    Forget a survey; the id of the build that takes it out of the map, None when not asked for.

    Roads that drives made are found again without it: where nobody else drove there is none.

    Raises:
        NotFound: There is no such survey.
    """
    with write(engine) as connection:
        touched = surveys.delete(connection, survey_id)
        if touched is None:
            raise NotFound("survey", survey_id)
        drives.find_again(connection, touched)
        return join_build(connection, touched) if build else None
