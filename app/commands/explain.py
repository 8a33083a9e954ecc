"""An explained answer as tables that a person reads."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from app.commands.target import Document

MOST_CELLS = 12  # the rest of a long list says little; --json has them all
MOST_SAMPLES = 20  # the newest ones
PLACES = ("answer", "runner_up")


def explanation_tables(told: Document) -> Group:
    """Sentences first, then what each cell adds, the features, and the samples' residuals."""
    parts: list[RenderableType] = [Text(sentence) for sentence in told["words"]]
    parts += [_contributions(told), _features(told), _residuals(told["samples"])]
    if told["not_heard"]:
        parts.append(_not_heard(told["not_heard"]))
    return Group(*parts)


def _contributions(told: Document) -> Table:
    """Adds up: its last line is the difference of the two scores."""
    table = _table("what decided, in nats for the answer against the runner-up")
    for name in ("cell", "level", "hearing", "total"):
        table.add_column(name, justify="left" if name == "cell" else "right")
    for name in ("off by, answer", "off by, runner-up"):
        table.add_column(name, justify="right")
    shown, rest = told["cells"][:MOST_CELLS], told["cells"][MOST_CELLS:]
    for one in shown:
        table.add_row(
            *(one["cell"], *(f"{one[name]:+.2f}" for name in ("level", "hearing", "total"))),
            *(_number(one[f"{place}_residual_db"], "+.1f", " dB") for place in PLACES),
        )
    if rest:
        sums = [sum(one[name] for one in rest) for name in ("level", "hearing", "total")]
        table.add_row(f"{len(rest)} more", *(f"{value:+.2f}" for value in sums))
    table.add_row("device offset", "", "", f"{told['offset_contribution']:+.2f}")
    table.add_row("[bold]together[/]", "", "", f"[bold]{told['score_difference']:+.2f}[/]")
    table.caption = (
        f"divided by {told['temperature']:.2f} before it is a probability; "
        f"device offset {told['device_offset_db']:+.1f} dB taken out of the levels"
    )
    return table


def _features(told: Document) -> Table:
    """Salient ones only: * for the answer's sub-segment or road, + for the runner-up's."""
    table = _table("salient features of the window, and as the map predicts them")
    for name in ("feature", "cell", "", "window", "answer", "runner-up"):
        table.add_column(name, justify="left" if name in ("feature", "cell", "") else "right")
    for kind, feature in told["features"].items():
        for at, cell in enumerate(told["samples"]["cells"]):
            marks = _marks(feature, at)
            if marks:
                values = (feature[name][at] for name in ("window", *PLACES))
                name = f"{kind.replace('_', ' ')}, {feature['unit']}"
                table.add_row(name, cell, marks, *(_number(value, ".2f") for value in values))
    table.caption = "* salient for the answer's road or sub-segment, + for the runner-up's"
    return table


def _marks(feature: Document, at: int) -> str:
    signs = zip(PLACES, "*+", strict=True)
    return "".join(
        sign
        for place, sign in signs
        if feature[f"{place}_road_mask"][at] or feature[f"{place}_segment_mask"][at]
    )


def _residuals(samples: Document) -> Table:
    """One row a sample, one column a cell; a dash where not heard or not mapped."""
    count = len(samples["behind_m"])
    first, cells = max(count - MOST_SAMPLES, 0), samples["cells"][:MOST_CELLS]
    newest = f", the last {MOST_SAMPLES} of {count} samples" if first else ""
    table = _table(f"readings minus the fit, dB{newest}")
    table.add_column("metres back", justify="right")
    for cell in cells:
        table.add_column(cell, justify="right")
    newest_rows = samples["residual_db"][first:]
    for behind_m, row in zip(samples["behind_m"][first:], newest_rows, strict=True):
        table.add_row(f"{behind_m:.0f}", *(_number(each, "+.1f") for each in row[: len(cells)]))
    return table


def _not_heard(missing: list[Document]) -> Table:
    table = _table("expected there, and not heard")
    table.add_column("cell")
    table.add_column("expected", justify="right")
    for one in missing[:MOST_CELLS]:
        table.add_row(one["cell"], f"{one['hearing']:.0%}")
    return table


def _table(title: str) -> Table:
    return Table(title=title, title_justify="left", caption_justify="left", title_style="bold")


def _number(value: float | None, form: str, unit: str = "") -> str:
    return "-" if value is None else f"{value:{form}}{unit}"
