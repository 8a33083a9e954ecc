"""What Prometheus may ask: requests by route, fixes by outcome, the map in force."""

from __future__ import annotations

from pathlib import Path

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from prometheus_client.multiprocess import MultiProcessCollector

# From a fix (a fraction of a millisecond) to a large survey (seconds).
DURATION_BUCKETS_S = (
    0.00025, 0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0,
)  # fmt: skip

RouteKey = tuple[str, str, int]


class Metrics:
    """
    The counters of one application.

    Labelled children are kept, because looking one up by its labels costs more than counting does.
    With several API processes each writes to ``shared_dir`` and whoever is asked adds them up.
    """

    def __init__(self, shared_dir: Path | None = None) -> None:
        self._shared_dir = shared_dir
        self._registry = CollectorRegistry()
        self._requests = Counter(
            "roadprint_requests",
            "Requests answered.",
            ["method", "route", "status"],
            registry=self._registry,
        )
        self._durations = Histogram(
            "roadprint_request_duration_seconds",
            "From the request's head to the last byte of its answer.",
            ["method", "route"],
            buckets=DURATION_BUCKETS_S,
            registry=self._registry,
        )
        self._fixes = Counter(
            "roadprint_fixes", "Windows answered.", ["status"], registry=self._registry
        )
        self._map_version = Gauge(
            "roadprint_map_version",
            "Version of the map in memory; 0 when there is none.",
            registry=self._registry,
            multiprocess_mode="livemin",
        )
        self._children: dict[RouteKey, tuple[Counter, Histogram]] = {}
        self._fix_children = {
            status: self._fixes.labels(status) for status in ("located", "off_map", "refused")
        }

    def request(self, method: str, route: str, status: int, duration_s: float) -> None:
        """One request answered; ``route`` is the template, never the path with its ids."""
        key = (method, route, status)
        children = self._children.get(key)
        if children is None:
            children = self._children[key] = (
                self._requests.labels(method, route, str(status)),
                self._durations.labels(method, route),
            )
        children[0].inc()
        children[1].observe(duration_s)

    def fix(self, status: str) -> None:
        """One window answered: ``located``, ``off_map`` or ``refused``."""
        self._fix_children[status].inc()

    def render(self, map_version: int | None) -> bytes:
        """The text exposition format, over all API processes."""
        self._map_version.set(map_version or 0)
        if self._shared_dir is None:
            return generate_latest(self._registry)
        shared = CollectorRegistry()
        MultiProcessCollector(shared, path=str(self._shared_dir))  # type: ignore[no-untyped-call]
        return generate_latest(shared)
