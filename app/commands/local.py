"""A data folder without a service: the same services called directly, a worker while it builds."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Self

import orjson
from pydantic import TypeAdapter, ValidationError

from app.api.answers import located_document
from app.api.box import bounds_of_query
from app.api.coverage import coverage_document
from app.api.faults import invalid_input
from app.api.reliability import reliability_document
from app.api.replies import OPTIONS
from app.api.schemas.locate import LocateRequest
from app.api.state import Limits
from app.api.surveys import Described, trace_of_json
from app.commands.target import BuildView, Document, Posted, Refused, RoadView
from app.domain import Road, Trace
from app.errors import NoMap, RoadprintError
from app.numerics.index import MapIndex
from app.numerics.lines import length_m
from app.services.builds import BuildState, get_build, request_build
from app.services.coverage import survey_coverage
from app.services.ingest import accept_survey
from app.services.keys import state_key
from app.services.maps import get_map
from app.services.publish import MapHolder
from app.services.roads import list_roads, put_road
from app.services.supervisor import start_worker_process
from app.settings import Settings
from app.store.engine import create_store_engine
from app.store.migrate import migrate

POLL_S = 0.2

_window_adapter = TypeAdapter(LocateRequest)


class LocalTarget:
    """The store of ``settings``, made when it is absent. Use as a context manager."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        settings.data_dir.mkdir(parents=True, exist_ok=True)
        self._engine = create_store_engine(
            settings.store_url, busy_timeout_ms=settings.busy_timeout_ms
        )
        migrate(self._engine)
        self._maps = MapHolder()
        self._limits = Limits(**{name: getattr(settings, name) for name in Limits.__slots__})

    def __enter__(self) -> Self:
        """Open for requests."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the store."""
        self._engine.dispose()

    def put_road(self, road: Road) -> None:
        """Create a road, or set its name and line."""
        put_road(self._engine, road)

    def list_roads(self) -> Iterator[RoadView]:
        """All roads by id, as the active map has them."""
        cursor: str | None = None
        while True:
            page = list_roads(self._engine, limit=1000, cursor=cursor)
            for road in page.items:
                drawn_m = None if road.line is None else length_m(road.line)
                yield RoadView(
                    road.road_id,
                    road.name,
                    drawn_m if road.length_m is None else road.length_m,
                    road.survey_count,
                    road.pass_count,
                )
            cursor = page.next_cursor
            if cursor is None:
                return

    def post_survey(self, document: Document, key: str | None) -> Posted:
        """Store one survey, checked as the API checks it, without building."""
        try:
            trace = trace_of_json(orjson.dumps(document), Described())
        except RoadprintError as error:
            raise Refused(error.code, str(error)) from error
        return self.post_trace(trace, key)

    def post_trace(self, trace: Trace, key: str | None) -> Posted:
        """Store one survey whose values are sound already, without building."""
        try:
            accepted = accept_survey(self._engine, trace, idempotency_key=key, build=False)
        except RoadprintError as error:
            raise Refused(error.code, str(error)) from error
        return Posted(accepted.survey_id, accepted.roads, accepted.replayed)

    def request_build(self, road_ids: Sequence[str] | None) -> BuildView:
        """Ask for a build of these roads, of all when None."""
        try:
            return _view(request_build(self._engine, road_ids))
        except RoadprintError as error:
            raise Refused(error.code, str(error)) from error

    def follow(self, build_id: str) -> Iterator[BuildView]:
        """The build's states as a worker of our own, or one that runs already, brings it on."""
        worker = start_worker_process(self._quiet_settings())
        try:
            while True:
                view = _view(get_build(self._engine, build_id))
                yield view
                if view.finished:
                    return
                time.sleep(POLL_S)
        finally:
            worker.stop()

    def reliability(self, version: int) -> Document:
        """How far a map version can be trusted."""
        try:
            return reliability_document(get_map(self._engine, version))
        except RoadprintError as error:
            raise Refused(error.code, str(error)) from error

    def coverage(
        self, *, bbox: str | None, version: int | None, cursor: str | None = None
    ) -> Document:
        """A page of stretches and the summary of all."""
        try:
            box = None if bbox is None else bounds_of_query(bbox)
            found = survey_coverage(self._engine, version=version, bbox=box, cursor=cursor)
        except RoadprintError as error:
            raise Refused(error.code, str(error)) from error
        return _plain(coverage_document(found))

    def locate(self, document: Document) -> Document:
        """The fix of one window on the active map."""
        try:
            request = _window_adapter.validate_json(orjson.dumps(document))
            key = state_key(self._engine, self._settings.state_key)
            _, located = located_document(self._index(), request, self._limits, key)
        except ValidationError as error:
            raise Refused("invalid-input", str(invalid_input(error))) from error
        except RoadprintError as error:
            raise Refused(error.code, str(error)) from error
        return _plain(located)

    def _quiet_settings(self) -> Settings:
        """Settings under which a worker says only what is wrong, unless a level was chosen."""
        if "log_level" in self._settings.model_fields_set:
            return self._settings
        return self._settings.model_copy(update={"log_level": "warning"})

    def _index(self) -> MapIndex:
        self._maps.refresh(self._engine)
        if self._maps.current is None:
            raise NoMap
        return self._maps.current


def _plain(document: object) -> Document:
    """As it comes back from a service: arrays and moments are lists and texts."""
    plain: Document = orjson.loads(orjson.dumps(document, option=OPTIONS))
    return plain


def _view(build: BuildState) -> BuildView:
    return BuildView(
        build_id=build.id,
        status=build.status,
        roads_done=build.roads_done,
        roads_total=build.roads_total,
        map_version=build.map_version,
        failed_roads=tuple(f"{each.road_id}: {each.detail}" for each in build.failed_roads),
        problem=(build.problem or {}).get("detail"),
    )
