# What app/numerics/kernels/module.c offers; app.numerics.native says what it is for.

from collections.abc import Sequence
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Singles: TypeAlias = NDArray[np.float32]
Wholes: TypeAlias = NDArray[np.signedinteger[Any]]
Likelihood: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]

_Kind = TypeVar("_Kind")

VERSION: int

def heard_columns(rsrp_dbm: Floats, /) -> list[int]: ...
def joined(base: Wholes, code: Wholes, joint: Wholes, /) -> None: ...
def gains(base: Wholes, codes: Wholes, label: Wholes, gain_bits: Floats, /) -> None: ...
def evidence(
    distance_m: Floats,
    rsrp_dbm: Floats,
    columns: list[int],
    carrier: list[int],
    step_m: float,
    centre_dbm: float,
    correlation_m: float,
    block: Floats,
    /,
) -> int: ...
def without_wild(
    distance_m: Floats,
    rsrp_dbm: Floats,
    neighbours: int,
    least: int,
    reach_m: float,
    sure_db: float,
    times: float,
    left_dbm: Floats,
    /,
) -> int: ...
def listen(
    block: Floats, samples: int, usual: Floats, few: float, enough: float, least: float, /
) -> tuple[float, float]: ...
def elsewhere(
    block: Floats,
    samples: int,
    cells: int,
    mean_db2: float,
    field_db2: float,
    field_m: float,
    noise_db2: float,
    reading_log: float,
    temperature: float,
    /,
) -> float: ...
def this_road(
    block: Floats,
    samples: int,
    numbers: list[int],
    group: list[int],
    rows: Singles,
    low: int,
    share: float,
    sign: int,
    step_m: float,
    factor: float,
    drift_db2: float,
    drift_m: float,
    much_drift_db2: float,
    much_drift_m: float,
    shadowing_db2: float,
    shadowing_m: float,
    noise_times: float,
    background_log: float,
    temperature: float,
    mean_db2: float,
    field_db2: float,
    field_m: float,
    noise_db2: float,
    reading_log: float,
    devices: Likelihood,
    /,
) -> tuple[float, float, float, float, float]: ...
def tape(
    block: Floats,
    samples: int,
    numbers: list[int],
    group: list[int],
    blocks: Singles,
    outside: Singles,
    positions: Wholes,
    step_m: float,
    likelihood: Likelihood,
    score: Singles,
    arms: Wholes = ...,
    parts: Singles = ...,
    /,
) -> None: ...
def turns(
    parts: Singles,
    onto: Wholes,
    off: Wholes,
    room: Wholes,
    first: int,
    last: int,
    likelihood: Likelihood,
    score: Singles,
    /,
) -> None: ...
def heaviest(
    score: Singles,
    temperature: float,
    left_out: float,
    not_looked_at: float,
    most: int,
    kept: Wholes,
    /,
) -> tuple[int, bool, float]: ...
def with_neighbours(
    number: Wholes, rows: Wholes, here: Wholes, scores: int, found: Wholes, /
) -> int: ...
def stretches_of_coarse(
    chainage_m: Floats,
    road: Wholes,
    sign: Wholes,
    step_m: float,
    joined_m: float,
    roads_step_m: Floats,
    size: Wholes,
    /,
) -> list[tuple[int, int, int, int]]: ...
def candidates(
    kind: type[_Kind],
    rivals: Sequence[tuple[int, int, int, float, float, float, float]],
    names: tuple[str, ...],
    forward: object,
    backward: object,
    share: float,
    /,
) -> tuple[_Kind, ...]: ...
def rest(
    score: Singles,
    runs: Wholes,
    covered: Wholes,
    temperature: float,
    step_m: float,
    highest: float,
    aligned_m: float,
    left_out: float,
    best: Wholes,
    width_m: Floats,
    /,
) -> int: ...
def kept_by_mass(
    score: Singles, temperature: float, left_out: float, most: int, kept: Wholes, /
) -> int: ...
def stretch(
    block: Floats,
    samples: int,
    numbers: list[int],
    group: list[int],
    rows: Singles,
    road: int,
    sign: int,
    first: int,
    last: int,
    step_m: float,
    length_m: float,
    likelihood: Likelihood,
    where: Wholes,
    values: Floats,
    at: int,
    /,
) -> None: ...
def rows(
    where: Wholes,
    values: Floats,
    step_m: Floats,
    lowest: float,
    around: int,
    least: int,
    most: int,
    /,
) -> list[tuple[int, int, int]]: ...
def redrawn(
    block: Floats,
    samples: int,
    numbers: list[int],
    group: list[int],
    bend: Singles,
    where: Wholes,
    values: Floats,
    first: int,
    end: int,
    parts: int,
    step_m: float,
    like_db2: float,
    new_where: Wholes,
    new_values: Floats,
    /,
) -> None: ...
def stretches_about(
    where: Wholes,
    values: Floats,
    step_m: Floats,
    size: Wholes,
    within: float,
    lightest: float,
    widest_m: float,
    reach_m: float,
    most_m: float,
    /,
) -> tuple[float, list[tuple[int, int, int, int]]]: ...
def under_factors(
    block: Floats,
    samples: int,
    numbers: list[int],
    group: list[int],
    stretches: list[tuple[Singles, Singles, list[int], int, int, int, int, float, float]],
    factors: Floats,
    log_priors: Floats,
    temperature: float,
    far: int,
    far_from: float,
    likelihood: Likelihood,
    step_m: Floats,
    lowest: float,
    around: int,
    least: int,
    most: int,
    parts: int,
    where_before: Wholes,
    values_before: Floats,
    straight: int,
    where: Wholes,
    values: Floats,
    log_prior: Floats,
    factor: Floats,
    /,
) -> tuple[int, float]: ...
def summary(
    where: Wholes,
    values: Floats,
    start: Wholes,
    size: Wholes,
    segment: Wholes,
    step_m: Floats,
    plane: Floats,
    edge_m: Floats,
    first_edge: Wholes,
    temperature: float,
    near_m: float,
    foot: float,
    confidence: float,
    position_sd_m: float,
    segment_sd_m: float,
    reach_sds: float,
    negligible_mass: float,
    spared: float,
    negligible_candidate: float,
    /,
) -> tuple[
    int,
    float,
    int,
    float,
    float,
    float,
    float,
    float,
    list[tuple[int, int, int, float, float, float, float]],
]: ...
