"""
Phones and networks unlike the surveys': `python -m benchmarks.other_phones [WORD ...]`.

Survey passes of real streets held out by day, as in `benchmarks.real_streets`: each of four maps is
asked windows of the days that it lacks, as they were heard and as another phone might have heard
them: one that lists fewer cells, is deafer, noisier, louder by another law, slower, or whose log
holds readings that no antenna sent. `--whose survey` changes the survey instead, as if driven with
such a phone, and `--whose both` either, as on the streets of another operator; each change then has
maps of its own. Words choose among the changes by name. Some ten minutes of one core for phones,
three for each survey.
"""

from __future__ import annotations

import argparse
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from app.domain import Road, Trace
from app.evaluation.passes import Drive, cut_windows
from app.numerics.carriers import carrier_of
from app.numerics.reliability import auroc, calibration_error, curve_of
from benchmarks.first_night import LENGTHS_M, REAL, Driven, survey_of
from benchmarks.real_streets import FOLDS, HELD_OUT_SEEDS, Maps, Row

Levels = Float[np.ndarray, "samples cells"]
Change = Callable[[Drive], Drive]
CENTRE_DBM = -90.0  # where a receiver of another slope reads as the surveys' does


def main() -> None:
    """Print a line for each change and length."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*", help="of the changes' names; without, all are asked")
    parser.add_argument("--data", type=Path, default=REAL)
    parser.add_argument("--windows", type=int, default=320, help="of each length, of all folds")
    parser.add_argument("--whose", choices=("phone", "survey", "both"), default="phone")
    chosen = parser.parse_args()
    roads, every = survey_of(chosen.data)
    named = {
        name: change
        for name, change in CHANGES.items()
        if not chosen.words or any(word in name for word in chosen.words)
    }
    as_it_was = CHANGES["as it was"]
    alike = list(folds_of(roads, every, as_it_was)) if chosen.whose == "phone" else []
    for name, change in named.items():
        folds = alike or list(folds_of(roads, every, change))
        asked = as_it_was if chosen.whose == "survey" else change
        for length_m in LENGTHS_M:
            rows = [
                maps.answered(one)
                for maps, held_out in folds
                for one in cut_windows(
                    [asked(drive) for drive in held_out],
                    chosen.windows // FOLDS,
                    length_m=length_m,
                    seed=HELD_OUT_SEEDS[0],
                )
                if one.window.cells
            ]
            print(f"  {name:32s} {length_m:3.0f} m  {described(rows)}", flush=True)


def folds_of(
    roads: Sequence[Road], every: Sequence[Driven], change: Change
) -> Iterator[tuple[Maps, list[Drive]]]:
    """Maps of changed passes, each without a quarter of the days, and the drives of these days."""
    days = sorted({one.day for one in every})
    for fold in range(FOLDS):
        out = set(days[fold::FOLDS])
        used = [replace(one, drive=change(one.drive)) for one in every if one.day not in out]
        maps = Maps(roads, [one for one in used if np.isfinite(one.drive.trace.rsrp_dbm).any()])
        yield maps, [one.drive for one in every if one.day in out and maps.has(one.drive.road_id)]


def described(rows: Sequence[Row]) -> str:
    """A line of figures."""
    road, _, _, error_m, said, _, in68, in95, refused, here, strange = np.array(rows, dtype=float).T
    ece = calibration_error(curve_of(said, road > 0.0))
    return (
        f"{len(rows)} windows  road {road.mean():.1%}, said {said.mean():.1%}  "
        f"median {np.median(error_m):5.1f} m  ECE {ece:.1%}  "
        f"68 % radius {in68.mean():.0%}  95 % {in95.mean():.0%}  refused {refused.mean():.1%}  "
        f"AUROC {auroc(strange, here):.3f}"
    )


def heard_as(levels: Callable[[Trace], Levels]) -> Change:
    """A change of what is heard, sample by sample."""

    def change(drive: Drive) -> Drive:
        rsrp_dbm = levels(drive.trace).astype(np.float32)
        return replace(drive, trace=replace(drive.trace, rsrp_dbm=rsrp_dbm))

    return change


def strongest(count: int) -> Change:
    """So many cells of each sample, as phones list."""

    def levels(trace: Trace) -> Levels:
        loudness = np.where(np.isnan(trace.rsrp_dbm), -np.inf, trace.rsrp_dbm)
        rank = np.argsort(np.argsort(-loudness, axis=1, kind="stable"), axis=1)
        return np.where(rank < count, trace.rsrp_dbm, np.nan)

    return heard_as(levels)


def half_of_the_carriers(half: int) -> Change:
    """A phone, or an operator, without the others' bands."""

    def levels(trace: Trace) -> Levels:
        kept = [zlib.crc32(carrier_of(cell).encode()) % 2 == half for cell in trace.cells]
        return np.where(kept, trace.rsrp_dbm, np.nan)

    return heard_as(levels)


def noisier(sd_db: float) -> Change:
    """Noise on top of the phone's own."""
    return heard_as(lambda t: t.rsrp_dbm + draw(t).normal(0.0, sd_db, t.rsrp_dbm.shape))


def missing(share: float) -> Change:
    """Readings that a log lacks."""
    return heard_as(
        lambda t: np.where(draw(t).random(t.rsrp_dbm.shape) < share, np.nan, t.rsrp_dbm)
    )


def wild(share: float) -> Change:
    """Readings that are any level from -125 to -65 dBm."""

    def levels(trace: Trace) -> Levels:
        rng = draw(trace)
        spoilt = (rng.random(trace.rsrp_dbm.shape) < share) & ~np.isnan(trace.rsrp_dbm)
        return np.where(spoilt, rng.uniform(-125.0, -65.0, spoilt.shape), trace.rsrp_dbm)

    return heard_as(levels)


def each(number: int) -> Change:
    """One sample of so many."""

    def change(drive: Drive) -> Drive:
        kept, trace = slice(None, None, number), drive.trace
        thinned = replace(
            trace,
            time_s=trace.time_s[kept],
            lon=trace.lon[kept],
            lat=trace.lat[kept],
            rsrp_dbm=trace.rsrp_dbm[kept],
        )
        return replace(
            drive,
            trace=thinned,
            chainage_m=drive.chainage_m[kept],
            travelled_m=drive.travelled_m[kept],
        )

    return change


def draw(trace: Trace) -> np.random.Generator:
    """The same numbers for the same pass."""
    return np.random.default_rng(zlib.crc32(trace.lat.tobytes() + trace.time_s.tobytes()))


CHANGES: dict[str, Change] = {
    "as it was": lambda drive: drive,
    "the strongest four of a sample": strongest(4),
    "the strongest two of a sample": strongest(2),
    "the strongest of a sample": strongest(1),
    "half of the carriers": half_of_the_carriers(0),
    "the other half": half_of_the_carriers(1),
    "deaf below -105 dBm": heard_as(lambda t: np.where(t.rsrp_dbm < -105.0, np.nan, t.rsrp_dbm)),
    "three readings of ten missing": missing(0.3),
    "one reading of a hundred wild": wild(0.01),
    "three of a hundred": wild(0.03),
    "one of ten": wild(0.1),
    "noisier by 2 dB": noisier(2.0),
    "noisier by 3 dB": noisier(3.0),
    "lower by 8 dB": heard_as(lambda t: t.rsrp_dbm - 8.0),
    "levels 0.85 as far from -90 dBm": heard_as(
        lambda t: CENTRE_DBM + 0.85 * (t.rsrp_dbm - CENTRE_DBM)
    ),
    "in steps of 3 dB": heard_as(lambda t: np.rint(t.rsrp_dbm / 3.0) * 3.0),
    "a sample in three seconds": each(3),
}


if __name__ == "__main__":
    main()
