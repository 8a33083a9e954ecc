"""The map in memory, and keeping it the active one without ever touching a request."""

from __future__ import annotations

import logging
import threading

from sqlalchemy.engine import Engine

from app.numerics.index import MapIndex
from app.services.maps import active_version, load_radio_map

log = logging.getLogger(__name__)


class MapHolder:
    """
    The map that this process serves.

    ``current`` is replaced by one assignment: whoever read it keeps a whole map to the end of his
    request, and nobody ever sees half of one. It is None before the first map, and while the active
    version maps no road.
    """

    def __init__(self) -> None:
        self.current: MapIndex | None = None
        self.version: int | None = None
        self._refreshing = threading.Lock()

    def refresh(self, engine: Engine) -> bool:
        """Load the active version if it is another than the one held; True when it changed."""
        with self._refreshing:
            version = active_version(engine)
            if version == self.version:
                return False
            loaded = None
            if version is not None:
                radio_map = load_radio_map(engine, version)
                loaded = MapIndex.build(radio_map) if radio_map.models else None
            self.current = loaded
            self.version = version
            return True

    def keep_word(self, engine: Engine, told_version: int | None) -> None:
        """
        Serve no older map than one that a client was just told of.

        Whoever learns that a build has finished asks for a fix at once; without this he would be
        answered by the map before it until the next poll.
        """
        if told_version is not None and (self.version is None or self.version < told_version):
            self.refresh(engine)

    def poll(self, engine: Engine, interval_s: float, stop: threading.Event) -> None:
        """Refresh every ``interval_s`` seconds until ``stop`` is set; for a daemon thread."""
        while not stop.wait(interval_s):
            try:
                if self.refresh(engine):
                    log.info("serving map version %s", self.version)
            except Exception:  # whatever is wrong with the store or the map: the old one serves on
                log.exception("could not take over the active map; the present one is served on")
