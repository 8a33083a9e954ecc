"""How far a map can be trusted, in a few lines."""

from __future__ import annotations

from app.commands.target import Document


def reliability_words(found: Document) -> list[str]:
    """
    Three lines of a `GET /v1/maps/{version}/reliability`, and its note.

    A map that measured nothing has its note alone.
    """
    note = [] if found["note"] is None else [f"note: {found['note']}"]
    if not found["window_count"]:
        return note
    return [_places(found), _probabilities(found), _off_map(found), *note]


def _places(found: Document) -> str:
    windows = f"{found['window_count']:,} held-out windows"
    measured = f"{found['measured_count']:,} of other passes than their curves"
    position = found["position"]
    return (
        f"places: the road was right for {_share(found['road']['right'])} of {windows} "
        f"({measured}); half lay within {position['median_m']:.1f} m of the truth, nine in ten "
        f"within {position['p90_m']:.1f} m"
    )


def _probabilities(found: Document) -> str:
    held = " and ".join(
        f"{_share(each['share'])} at {100.0 * each['confidence']:.0f} %"
        for each in found["position"]["coverage"]
        if each["confidence"] in (0.68, 0.95)
    )
    segment = found["segment"]["ece"]
    and_segment = "" if segment is None else f", the sub-segment's by {_share(segment)}"
    return (
        f"probabilities: the road's is off by {_share(found['road']['ece'])} on average"
        f"{and_segment}; "
        f"the radius held the truth for {held}"
    )


def _off_map(found: Document) -> str:
    off_map = found["off_map"]
    return (
        f"off the map: {_share(off_map['refused'])} of windows on it were refused, "
        f"{_share(off_map['strangers_refused'])} of those whose road was taken out "
        f"(told apart with AUROC {off_map['auroc']:.3f})"
    )


def _share(value: float) -> str:
    return f"{100.0 * value:.1f} %"
