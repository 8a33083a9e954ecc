"""One random stream a purpose, so that asking for more of one thing shifts nothing else."""

from __future__ import annotations

import enum

import numpy as np


class Purpose(enum.IntEnum):
    """What a stream is drawn for. The numbers are part of every result: never reuse one."""

    SITES = 1
    SHADOWING_NODES = 2
    SHADOWING_ROAD = 3
    DRIFT_NODES = 4
    DRIFT_ROAD = 5
    HEARD_COUNT = 6
    SURVEY = 7
    DRIVE = 8
    WINDOW = 9
    ODOMETER = 10
    TOUR = 11
    GIFT = 12
    BOOTSTRAP = 13
    START = 14


def stream(seed: int, purpose: Purpose, *key: int) -> np.random.Generator:
    """The generator of one purpose and key (a cell, a road, a window) under a seed."""
    sequence = np.random.SeedSequence(entropy=seed, spawn_key=(int(purpose), *key))
    return np.random.Generator(np.random.PCG64(sequence))
