"""What every compared method is built from, is asked, and answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, runtime_checkable

from app.domain import Direction, Line, Road, Trace, Window


class Place(NamedTuple):
    """WGS 84 degrees."""

    lon: float
    lat: float


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """
    What a method may learn from.

    Attributes:
        roads: Each with its line.
        traces: The survey's passes; each names its road.
        grid_m: Spacing of reference points, for the methods that have them.
        window_m: Length of the windows that will be asked: free parameters are chosen for it.
        sites: Where cells stand, for those of which that is known.
    """

    roads: tuple[Road, ...]
    traces: tuple[Trace, ...]
    grid_m: float
    window_m: float
    sites: Mapping[str, Place] = field(default_factory=dict)

    def line(self, road_id: str) -> Line:
        """
        The centre line of a road.

        Raises:
            KeyError: No such road, or it has no line.
        """
        for road in self.roads:
            if road.road_id == road_id and road.line is not None:
                return road.line
        raise KeyError(road_id)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """
    A method's answer: where the last sample of the window was.

    Attributes:
        direction: None where the method does not tell it.
        posterior: Probability of the reported sub-segment, None where the method has none.
        segment: First and last chainage of that sub-segment.
        located: False when the method says that the window is on no mapped road.
        memory: What a sequential method wants to see again with the drive's next window.
    """

    road_id: str
    chainage_m: float
    lon: float
    lat: float
    direction: Direction | None = None
    posterior: float | None = None
    segment: tuple[float, float] | None = None
    located: bool = True
    memory: object = None


@dataclass(frozen=True, slots=True, eq=False)
class Previous:
    """A method's own answer to the drive's last window, ``since_m`` of travel before this one's."""

    estimate: Estimate
    since_m: float


@runtime_checkable
class Model(Protocol):
    """A method that has learnt."""

    def locate(self, window: Window, previous: Previous | None) -> Estimate:
        """Where the last sample was; ``previous`` is None at the start of a drive."""
        ...


@runtime_checkable
class Confident(Protocol):
    """A model that also says how sure it is."""

    def radius_m(self, window: Window, confidence: float) -> float:
        """Radius about the answer that should hold the truth this often."""
        ...


@runtime_checkable
class Method(Protocol):
    """A named way to locate; ``parameters`` of a model say what was chosen."""

    name: str

    def fit(self, survey: Survey, seed: int) -> Model:
        """Learn; all free parameters are chosen on the survey alone."""
        ...
