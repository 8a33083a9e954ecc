"""Map versions: listing them, choosing the active one, loading one into memory."""

from __future__ import annotations

from sqlalchemy.engine import Engine

from app.domain import RadioMap
from app.errors import NotFound
from app.store import models, versions
from app.store.engine import read, write
from app.store.records import MapVersion

__all__ = ["MapVersion", "activate", "active_version", "get_map", "list_maps", "load_radio_map"]


def list_maps(engine: Engine) -> list[MapVersion]:
    """All map versions, newest first."""
    with read(engine) as connection:
        return versions.select_versions(connection)


def get_map(engine: Engine, version: int) -> MapVersion:
    """
    One map version.

    Raises:
        NotFound: There is no such version.
    """
    with read(engine) as connection:
        found = versions.select_versions(connection, version)
    if not found:
        raise NotFound("map version", version)
    return found[0]


def active_version(engine: Engine) -> int | None:
    """Number of the active map version, None before the first."""
    with read(engine) as connection:
        return versions.active_version(connection)


def activate(engine: Engine, version: int) -> MapVersion:
    """
    Make a version the active one; it may be an older one.

    Raises:
        NotFound: There is no such version.
    """
    with write(engine) as connection:
        if not versions.select_versions(connection, version):
            raise NotFound("map version", version)
        if versions.active_version(connection) != version:
            versions.activate(connection, version)
        return versions.select_versions(connection, version)[0]


def load_radio_map(engine: Engine, version: int) -> RadioMap:
    """
    A map version as matching needs it: bulk arrays only.

    The models' segments carry no curves and their evidence is empty: ``mean_dbm`` samples the
    curves, and a serving process neither evaluates splines nor calibrates.

    Raises:
        NotFound: There is no such version.
    """
    with read(engine) as connection:
        calibration = versions.select_calibration(connection, version)
        if calibration is None:
            raise NotFound("map version", version)
        loaded = models.load_models(connection, version)
    return RadioMap(version, tuple(loaded), calibration)
