"""The cells that a map knows."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request
from starlette.responses import Response

from app.api.documents import cell_document
from app.api.openapi import problems
from app.api.replies import unless_known
from app.api.schemas.roads import CellList
from app.api.state import EngineOf
from app.services.maps import active_version
from app.services.roads import list_cells

router = APIRouter(prefix="/v1/cells", tags=["maps"])


@router.get("", response_model=CellList, responses=problems(404))
def get_cells(
    request: Request,
    engine: EngineOf,
    map_version: Annotated[int | None, Query(ge=1, le=2**31 - 1)] = None,
) -> Response:
    """Every cell mapped, with where and how strongly it is heard."""
    version = map_version or active_version(engine)

    def make() -> object:
        cells = [cell_document(cell) for cell in list_cells(engine, version)]
        return {"map_version": version, "cells": cells}

    return unless_known(request, f"cells-{version}", make)
