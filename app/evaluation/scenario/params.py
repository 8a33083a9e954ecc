"""What may be chosen of a simulated city, and the named choices."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

KMH = 1000.0 / 3600.0
PAPER_CELLS = 6
PAPER_ROADS = 4


@dataclass(frozen=True, slots=True)
class Scenario:
    """
    A simulated city and how it is driven. The defaults are the paper's area.

    Attributes:
        layout: ``square``: 600 m x 600 m, a high-rise inside four roads, one macro cell and five
            small ones. ``grid``: street canyons between square blocks, a road a block.
        roads: Roads of the grid; the square has four.
        cells: How many cells transmit: the first of the layout, macro cells before small cells.
        frequency_ghz: One carrier for all, within the ranges of P.1411 tables 4 and 8.
        shadowing_los_db, shadowing_nlos_db: Standard deviation of the shadowing with and without
            line of sight.
        shadowing_correlation_m: Distance over which its correlation falls to 1/e (Gudmundson 1991).
        corner_m: Stretch over which the loss goes over from line of sight to none at a corner.
        noise_db: Standard deviation of each reading about the mean, independent.
        quantisation_db: Step of the reported RSRP; 0 reports it unrounded.
        sensitivity_dbm: A reading below is not heard.
        speed_mps: Speed of all drives.
        sample_interval_m: Distance between samples; used when ``sample_interval_s`` is None.
        sample_interval_s: Time between samples.
        survey_passes: Passes of the survey over each road.
        survey_position_noise_m: Standard deviation of a survey sample's position, per axis and
            sample, independent.
        both_directions: Windows are driven both ways, survey passes alternate; else all forward.
        device_offset_sd_db: Spread of the vehicles' common offset against the survey device.
        odometer_error_sd: Spread of the vehicles' odometer scale about 1.
        drift_db: Standard deviation of the change of the mean since the survey, per cell.
        drift_correlation_m: Distance over which that change varies.
        origin_lon, origin_lat: WGS 84 degrees of the area's south-west corner.
    """

    name: str = "paper"
    layout: Literal["square", "grid"] = "square"
    roads: int = PAPER_ROADS
    cells: int = PAPER_CELLS
    frequency_ghz: float = 2.6
    shadowing_los_db: float = 3.5
    shadowing_nlos_db: float = 6.0
    shadowing_correlation_m: float = 12.0
    corner_m: float = 20.0
    noise_db: float = 2.0
    quantisation_db: float = 1.0
    sensitivity_dbm: float = -125.0
    speed_mps: float = 30.0 * KMH
    sample_interval_m: float = 1.0
    sample_interval_s: float | None = None
    survey_passes: int = 1
    survey_position_noise_m: float = 0.0
    both_directions: bool = True
    device_offset_sd_db: float = 0.0
    odometer_error_sd: float = 0.0
    drift_db: float = 0.0
    drift_correlation_m: float = 100.0
    origin_lon: float = 11.5
    origin_lat: float = 48.1

    def __post_init__(self) -> None:
        """Refuse what no city can be built from, with the number."""
        positive = {
            "roads": self.roads,
            "cells": self.cells,
            "speed_mps": self.speed_mps,
            "survey_passes": self.survey_passes,
            "shadowing_correlation_m": self.shadowing_correlation_m,
            "drift_correlation_m": self.drift_correlation_m,
            "spacing_m": self.spacing_m,
        }
        for name, value in positive.items():
            if not value > 0:
                raise ValueError(f"{name} must be above 0, not {value}")
        if self.layout == "square" and (self.roads != PAPER_ROADS or self.cells > PAPER_CELLS):
            raise ValueError(
                f"the square has {PAPER_ROADS} roads and at most {PAPER_CELLS} cells, "
                f"not {self.roads} and {self.cells}"
            )

    @property
    def spacing_m(self) -> float:
        """Distance between two samples of a drive."""
        if self.sample_interval_s is None:
            return self.sample_interval_m
        return self.sample_interval_s * self.speed_mps


PAPER = Scenario()
CLEAN = replace(PAPER, name="clean", noise_db=0.0, quantisation_db=0.0)
HARSH = replace(
    PAPER,
    name="harsh",
    sample_interval_s=1.0,
    noise_db=3.0,
    device_offset_sd_db=4.0,
    odometer_error_sd=0.03,
    drift_db=2.0,
    survey_position_noise_m=3.0,
    survey_passes=3,
)
CITY = replace(PAPER, name="city", layout="grid", roads=1000, cells=300)

PRESETS: dict[str, Scenario] = {each.name: each for each in (CLEAN, PAPER, HARSH, CITY)}


def preset(name: str) -> Scenario:
    """
    The scenario of that name.

    Raises:
        ValueError: There is none; the message lists those there are.
    """
    if name not in PRESETS:
        raise ValueError(f"no scenario {name!r}: there are {', '.join(PRESETS)}")
    return PRESETS[name]
