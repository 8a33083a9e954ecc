"""Figures from the same rows as the tables, as SVG and PNG."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from app.evaluation.experiments.score import Row
from app.numerics.geodesy import Floats

COLOURS = {
    "paper": "#7f7f7f",
    "rwknn": "#e69f00",
    "gift": "#009e73",
    "cf-els": "#cc79a7",
    "exhaustive": "#56b4e9",
    "roadprint": "#d62728",
}  # of Okabe and Ito where there are enough: told apart by most colour-blind readers
MARKS = {
    "paper": "s",
    "rwknn": "^",
    "gift": "D",
    "cf-els": "v",
    "exhaustive": "o",
    "roadprint": "o",
}
BOUND: Any = {"color": "#222222", "linestyle": ":", "linewidth": 1.4}
SETTINGS: Any = {
    "font.size": 9,
    "font.family": "DejaVu Sans",
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "roadprint",
    "figure.constrained_layout.use": True,
}
PNG_DPI = 110
MOST_COLUMNS = 4  # so many panels or more go into two rows


@dataclass(frozen=True, slots=True)
class Drawn:
    """A figure as SVG text and PNG bytes."""

    svg: str
    png: bytes

    def write(self, folder: Path, name: str) -> None:
        """Both files."""
        (folder / f"{name}.svg").write_text(self.svg, encoding="utf-8")
        (folder / f"{name}.png").write_bytes(self.png)


def lines(rows: Sequence[Row], column: str, x_label: str, y_label: str) -> Drawn:
    """A figure against x, one panel a protocol; MDE with intervals and the bound."""

    def draw(axes: Sequence[Axes]) -> None:
        for axis, protocol in zip(axes, protocols, strict=True):
            _panel(axis, [row for row in rows if row["protocol"] == protocol], column)
            axis.set_title(protocol)
            axis.set_xlabel(x_label)
        axes[0].set_ylabel(y_label)
        handles, names = axes[0].get_legend_handles_labels()
        axes[-1].legend(handles, names, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)

    protocols = list(dict.fromkeys(row["protocol"] for row in rows))
    return _drawn(draw, len(protocols), share_y=True)


def _panel(axis: Axes, rows: Sequence[Row], column: str) -> None:
    ticks = list(dict.fromkeys((row["x"], row["label"]) for row in rows))
    place = {x: i for i, (x, _) in enumerate(ticks)}
    for method in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == method]
        x = np.array([place[row["x"]] for row in own], dtype=float)
        y = np.array([row[column] for row in own], dtype=float)
        style: Any = {"color": COLOURS[method], "marker": MARKS[method], "label": method}
        behind = method == "exhaustive"
        style |= {"markersize": 8 if behind else 4, "alpha": 0.7 if behind else 1.0}
        axis.plot(x, y, **style)
        if column == "mde_m":
            low = np.array([row["mde_low_m"] for row in own])
            high = np.array([row["mde_high_m"] for row in own])
            axis.fill_between(x, low, high, color=COLOURS[method], alpha=0.15, linewidth=0)
    bound = {place[row["x"]]: row["bound_m"] for row in rows if row["bound_m"] is not None}
    if column == "mde_m" and bound:
        axis.plot(list(bound), list(bound.values()), label="Cramer-Rao bound", **BOUND)
    axis.set_yscale("log")
    turned = max(len(label) for _, label in ticks) > 6
    axis.set_xticks(
        range(len(ticks)),
        [label for _, label in ticks],
        rotation=35 if turned else 0,
        ha="right" if turned else "center",
    )


def cdf(errors_m: dict[str, Floats]) -> Drawn:
    """Share of errors below each distance: near zero, and over the whole range."""

    def draw(axes: Sequence[Axes]) -> None:
        widest_m = max(float(error.max()) for error in errors_m.values())
        near_m = 2.0 if widest_m < 400 or _median(errors_m) < 2.0 else 20.0
        for method, error_m in errors_m.items():
            ordered = np.sort(error_m)
            share = np.arange(1, len(ordered) + 1) / len(ordered)
            style: Any = {"color": COLOURS[method], "label": method}
            if method == "exhaustive":
                style |= {"linewidth": 4, "alpha": 0.5}
            for axis in axes:
                axis.step(
                    np.concatenate([[0.0], ordered]), np.append(0.0, share), where="post", **style
                )
        axes[0].set_xlim(0, near_m)
        axes[1].set_xscale("symlog", linthresh=near_m)
        axes[1].set_xlim(0, widest_m * 1.05)
        for axis in axes:
            axis.set_xlabel("distance error, m")
            axis.set_ylim(0, 1.02)
        axes[0].set_ylabel("share of windows")
        handles, names = axes[0].get_legend_handles_labels()
        axes[-1].legend(handles, names, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)

    return _drawn(draw, 2, share_y=True)


def _median(errors_m: dict[str, Floats]) -> float:
    return min(float(np.median(error)) for error in errors_m.values())


def reliability(groups: Mapping[str, Sequence[Row]]) -> Drawn:
    """How often the sub-segment was right against what was said; areas count windows."""

    def draw(axes: Sequence[Axes]) -> None:
        for axis, (label, bins) in zip(axes, groups.items(), strict=True):
            axis.plot([0, 1], [0, 1], **BOUND)
            said = [each["said"] for each in bins]
            right = [each["right"] for each in bins]
            count = np.array([each["windows"] for each in bins], dtype=float)
            axis.plot(said, right, color=COLOURS["roadprint"], alpha=0.5)
            axis.scatter(said, right, s=15 + 200 * count / count.sum(), color=COLOURS["roadprint"])
            axis.set_title(label)
            axis.set_xlabel("posterior of the sub-segment")
            axis.set_ylim(-0.03, 1.03)
        axes[0].set_ylabel("share that was right")

    return _drawn(draw, len(groups), share_y=True)


def _drawn(draw: Callable[[Sequence[Axes]], None], panels: int, *, share_y: bool) -> Drawn:
    columns = panels if panels < MOST_COLUMNS else -(-panels // 2)
    rows = -(-panels // columns)
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(3.4 * columns + 1.6, 3.3 * rows))
        axes = list(figure.subplots(rows, columns, sharey=share_y, squeeze=False).ravel())
        for empty in axes[panels:]:
            empty.remove()
        draw(axes[:panels])
        svg, png = io.StringIO(), io.BytesIO()
        figure.savefig(svg, format="svg", metadata={"Date": None})
        figure.savefig(png, format="png", dpi=PNG_DPI, metadata={"Software": None})
    text = svg.getvalue()
    return Drawn(text[text.index("<svg") :], png.getvalue())
