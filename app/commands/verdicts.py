"""What a data set is good for, in words: each verdict with its number and what to do about it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

from app.formats import account as reasons
from app.formats.account import Account
from app.numerics.tally import Checkup

Mark = Literal["bad", "mind", "good", "note"]

# docs/surveying.md has where these come from.
FEW_KILOMETRES = 0.5
STANDING_MUCH = 0.6
COARSE_DECIMALS = 4  # 11 m of latitude
JITTER_M = 8.0
SERVING_ONLY = 0.9
RARE_S = 3.0
FAR_APART_M = 25.0
ONCE_MUCH = 0.5
DAYS_MUCH, DAYS_NONE = 0.3, 0.05
JUMPS_PER_HOUR = 2.0
DEGREE_M = 111_320.0


@dataclass(frozen=True, slots=True)
class Verdict:
    """One sentence, and what to do about it (empty: nothing)."""

    mark: Mark
    words: str
    advice: str = ""


def verdicts(found: Checkup, account: Account, roles: dict[str, int]) -> list[Verdict]:
    """Everything worth saying, what matters most first."""
    every = [verdict for judge in JUDGES for verdict in judge(found)]
    every += [*_rows(account), *_roles(roles)]
    order = {"bad": 0, "mind": 1, "good": 2, "note": 3}
    return sorted(every, key=lambda verdict: order[verdict.mark])


def _roads(found: Checkup) -> Iterator[Verdict]:
    ground = found.ground
    repeated = ground.few + ground.often
    if found.kilometres < FEW_KILOMETRES:
        yield Verdict(
            "bad",
            f"only {found.kilometres:.1f} km were driven: no map comes of that",
            "drive each street from end to end, both ways",
        )
    elif repeated >= ONCE_MUCH:
        yield Verdict(
            "good",
            f"good for finding roads: {repeated:.0%} of {ground.length_m / 1000:.1f} km of ground "
            f"were driven again, {ground.often:.0%} four times and more",
        )
    else:
        yield Verdict(
            "mind",
            f"{ground.once:.0%} of {ground.length_m / 1000:.1f} km of ground were driven only once",
            "four passes find the right road in 95 % of windows, two or three in 83 %: "
            "drive the same streets again before new ones",
        )


def _directions(found: Checkup) -> Iterator[Verdict]:
    both = found.ground.both_ways
    if found.kilometres >= FEW_KILOMETRES:
        good = both >= ONCE_MUCH
        yield Verdict(
            "good" if good else "mind",
            f"{both:.0%} of the ground were driven in both directions",
            "" if good else "drive back on the same streets: vehicles will come both ways",
        )


def _days(found: Checkup) -> Iterator[Verdict]:
    several = found.ground.several_days
    if not found.days:
        yield Verdict(
            "mind",
            f"none of the {found.drives:,} drives has a date: they count as one day, and "
            "probabilities cannot be tested on another day",
            "export with absolute times",
        )
    elif found.days == 1:
        yield Verdict(
            "bad",
            "one day only: probabilities cannot be tested on another day",
            "come back on another day: signals and positions differ from day to day",
        )
    elif several < DAYS_NONE:
        yield Verdict(
            "bad",
            f"{found.days} days, but on different ground ({several:.0%} in common): probabilities "
            "cannot be tested on another day",
            "repeat streets of earlier days",
        )
    else:
        good = several >= DAYS_MUCH
        yield Verdict(
            "good" if good else "mind",
            f"{found.days} days, and {several:.0%} of the ground on more than one: a day can be "
            "held out to test the map" + ("" if good else ", but of a small part only"),
            "" if good else "repeat streets of earlier days",
        )


def _cells(found: Checkup) -> Iterator[Verdict]:
    if found.serving_only >= SERVING_ONLY:
        yield Verdict(
            "mind",
            f"serving cell only ({found.serving_only:.0%} of samples hear one cell): expect tens "
            "of metres at 400 m windows, and roads mistaken at shorter ones",
            "log neighbour cells, too, where the tool or the phone can",
        )
    else:
        yield Verdict(
            "good",
            f"{found.cells_per_sample:.1f} cells a sample, {found.cells:,} different: "
            + ("serving and neighbours" if found.cells_per_sample >= 2 else "few neighbours"),
        )


def _positions(found: Checkup) -> Iterator[Verdict]:
    coarse = [
        (name, decimals)
        for name, decimals in zip(("latitude", "longitude"), found.decimals, strict=True)
        if decimals <= COARSE_DECIMALS
    ]
    for name, decimals in coarse:
        yield Verdict(
            "mind",
            f"{name} is rounded to {DEGREE_M * 10.0**-decimals:,.0f} m ({decimals} decimals)",
            "export six decimals; roads are found all the same, some metres worse",
        )
    if found.jitter_m is not None and found.jitter_m > JITTER_M and not coarse:
        yield Verdict(
            "mind",
            f"positions jitter by {found.jitter_m:.0f} m from fix to fix",
            "put the receiver where it sees the sky; parallel streets may be taken for one",
        )
    elif found.jitter_m is not None and not coarse:
        yield Verdict(
            "good", f"positions are steady: {jitter_words(found.jitter_m)} across the way"
        )
    if found.jumps > JUMPS_PER_HOUR * max(found.hours, 0.1):
        yield Verdict(
            "mind",
            f"{found.jumps:,} jumps that no car drives in {found.hours:.1f} h",
            "they are cleaned away; many mean a receiver that loses the sky",
        )


def _pace(found: Checkup) -> Iterator[Verdict]:
    apart_m = found.interval_s * found.speed_mps
    if apart_m > FAR_APART_M:
        yield Verdict(
            "mind",
            f"a sample each {apart_m:.0f} m ({found.interval_s:.1f} s at "
            f"{found.speed_mps * 3.6:.0f} km/h)",
            "log once a second, or drive slower: signals change within 10 to 20 m",
        )
    if found.standing > STANDING_MUCH:
        yield Verdict(
            "mind",
            f"the car stood {found.standing:.0%} of the time",
            "nothing is lost but time: standing samples of one place count as one",
        )


def _levels(found: Checkup) -> Iterator[Verdict]:
    weakest, _, strongest = found.rsrp_dbm
    if strongest - weakest < 20.0:
        yield Verdict(
            "mind",
            f"RSRP varies by {strongest - weakest:.0f} dB only",
            "make sure that the column is RSRP, and not a level in bars or a quality",
        )


def _cars(found: Checkup) -> Iterator[Verdict]:
    if found.overlapping:
        yield Verdict(
            "note",
            f"{found.overlapping:,} of {found.drives:,} drives overlap in time with another: "
            "several devices at once",
            "they count as passes and tell devices apart, but are no other day",
        )


def jitter_words(jitter_m: float) -> str:
    """A tenth of a metre is the finest that is counted."""
    return f"jitter {jitter_m:.1f} m" if jitter_m >= 0.1 else "jitter under 0.1 m"


JUDGES: tuple[Callable[[Checkup], Iterator[Verdict]], ...] = (
    _roads, _directions, _days, _cells, _positions, _pace, _levels, _cars,
)  # fmt: skip


def _rows(account: Account) -> Iterator[Verdict]:
    if account.faults:
        names = [reason for reason in account.dropped if reason in reasons.FAULTS]
        told = "; ".join(f"{r}: {account.dropped[r]:,} (line {account.places(r)})" for r in names)
        yield Verdict(
            "bad",
            f"{account.faults:,} rows are broken: {told}",
            "mend the file, or import its sound part with --keep-going",
        )
    fillers = account.dropped[reasons.FILLER] + account.dropped[reasons.OUT_OF_RANGE]
    if fillers:
        yield Verdict(
            "note",
            f"{fillers:,} fillers and impossible levels ({fillers / max(account.rows, 1):.1%} of "
            "the rows) are left out",
        )


def _roles(roles: dict[str, int]) -> Iterator[Verdict]:
    if roles.get("test"):
        yield Verdict(
            "note",
            f"an index keeps {roles['test']:,} of {sum(roles.values()):,} back for testing: they "
            "are counted here and not imported",
        )
