"""
A simulated city with its truth.

`build_city` makes roads, cells and the true mean RSRP at every chainage; `survey` drives it as a
survey team would, `drive` and `windows` as a vehicle would. Everything follows from a frozen
`Scenario` and a seed.
"""

from app.evaluation.scenario.build import build_city
from app.evaluation.scenario.city import City, RoadTruth
from app.evaluation.scenario.drives import drive, survey
from app.evaluation.scenario.params import PRESETS, Scenario, preset
from app.evaluation.scenario.windows import city_drives, windows

__all__ = [
    "PRESETS",
    "City",
    "RoadTruth",
    "Scenario",
    "build_city",
    "city_drives",
    "drive",
    "preset",
    "survey",
    "windows",
]
