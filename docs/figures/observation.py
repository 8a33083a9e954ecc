"""
Figures and numbers of docs/algorithms/observation-model.md: survey passes held out by day.

    .venv/bin/python docs/figures/observation.py [folder]    # writes observation/ beside this file

Fits every road without each of four folds of days and measures the passes of those days. The test
passes are not read. Takes some four minutes of one core.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import matplotlib as mpl
import numpy as np
import observation_measures as measures
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from observation_data import FOLDS, Laid, fit_folds, lay_each, lay_held_out, load
from observation_windows import (
    LENGTHS_M,
    SEED,
    TEMPERATURES,
    Answers,
    ask_all,
    indices,
    information,
    tried,
    windows,
)
from scipy.stats import norm
from scipy.stats import t as student

mpl.use("agg")
mpl.rcParams.update({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False})

import matplotlib.pyplot as plt  # noqa: E402  # after the backend is chosen

REAL = Path(__file__).resolve().parents[3] / "shared" / "data" / "santa_monica_att"
OUT = Path(__file__).with_name("observation")
WINDOWS = 300  # of each length
TRIED_WINDOWS = 200


def main() -> None:
    """Measure, draw and write."""
    OUT.mkdir(exist_ok=True)
    roads, driven = load(Path(sys.argv[1]) if len(sys.argv) > 1 else REAL)
    maps = fit_folds(roads, driven)
    laid = lay_held_out(driven, maps)
    usual = indices(maps)
    answers = [ask_all(usual, windows(roads, driven, length_m, WINDOWS)) for length_m in LENGTHS_M]
    told, models = information(answers)
    told_offsets, shared = measures.offsets(laid)
    numbers = {
        "protocol": {
            "passes": len(driven),
            "days": len({one.day for one in driven}),
            "folds": FOLDS,
            "seed": SEED,
            "rows": sum(len(one.chainage_m) for one in laid),
            "readings": int(sum((~np.isnan(one.residual_db)).sum() for one in laid)),
        },
        "spread_by_passes": measures.spread_by_passes(laid),
        "spread_by_said": measures.spread_by_said(laid),
        "spread_by_level": measures.spread_by_level(laid),
        "spread_of_cells": measures.spread_of_cells(laid),
        "correlation": measures.correlation(laid),
        "standing": measures.standing(driven),
        "steps": measures.steps(driven),
        "offsets": shared,
        "between_passes": measures.between_passes(lay_each(roads, driven)),
        "hearing_share": measures.hearing_by_share(laid, "share"),
        "hearing_served": measures.hearing_by_share(laid, "served"),
        "hearing_losses": measures.hearing_losses(laid),
        "heard_together": measures.heard_together(laid),
        "direction": measures.direction(laid),
        "tails": measures.tails(laid),
        "information": {"lengths": _lengths(answers), "parameters": told, "log_truth": models},
        "tried": tried(roads, driven, maps, TRIED_WINDOWS),
    }
    text = json.dumps(_rounded(numbers), indent=1)
    (OUT / "numbers.json").write_text(text + "\n", encoding="utf-8")
    draw_spread(numbers)
    draw_correlation(numbers)
    draw_tails(laid)
    draw_offsets(told_offsets)
    draw_hearing(numbers)
    draw_information(answers, told)


def _lengths(answers: list[Answers]) -> list[dict[str, float]]:
    """Of each window length, the temperature that made the truth most probable."""
    rows = []
    for length_m, one in zip(LENGTHS_M, answers, strict=True):
        mean_log = one.log_truth.mean(axis=0)
        rows.append(
            {
                "length_m": length_m,
                "weight": float(one.weight.mean()),
                "temperature": float(TEMPERATURES[mean_log.argmax()]),
                "log_truth": float(mean_log.max()),
                "log_truth_untempered": float(
                    np.mean([np.interp(0.0, np.log(TEMPERATURES), row) for row in one.log_truth])
                ),
                "road_right": float(one.right.mean()),
                "median_m": float(np.median(one.error_m)),
            }
        )
    return rows


def draw_spread(numbers: dict) -> None:
    """Found and said spread by passes, by what the map said, by level."""
    figure, (by_passes, by_said, by_level) = _figure(3)
    rows = numbers["spread_by_passes"]
    passes = [row["passes"] for row in rows]
    by_passes.plot(passes, [row["rms_db"] for row in rows], "o-", label="found")
    by_passes.plot(passes, [row["said_db"] for row in rows], "s--", color="0.5", label="said")
    by_passes.set(xlabel="passes that heard the cell there", ylabel="spread, dB", ylim=(0, 4.5))
    by_passes.legend(frameon=False)
    said = [row["said_db"] for row in numbers["spread_by_said"]]
    by_said.plot(said, [row["rms_db"] for row in numbers["spread_by_said"]], "o-")
    by_said.plot([1.5, 3.5], [1.5, 3.5], color="0.7", lw=0.8)
    by_said.set(xlabel="said, dB (3 passes or more)", ylabel="found, dB", ylim=(0, 4.5))
    rows = numbers["spread_by_level"]
    by_level.plot([row["level_dbm"] for row in rows], [row["rms_db"] for row in rows], "o-")
    by_level.set(xlabel="expected level, dBm (3 passes or more)", ylabel="found, dB", ylim=(0, 4.5))
    _write(figure, "spread")


def draw_correlation(numbers: dict) -> None:
    """Residuals' correlation along the road, and readings of a standing car."""
    figure, (along, still) = _figure(2)
    rows = numbers["correlation"]
    apart_m = [row["apart_m"] for row in rows]
    names = {
        "same_cell": "one cell",
        "same_carrier": "two cells of one carrier",
        "other_carrier": "two cells of different carriers",
        "hearing": "heard or not, one cell",
    }
    for kind, label in names.items():
        style = "--" if kind == "hearing" else "-"
        along.plot(apart_m[1:], [row[kind] for row in rows[1:]], "o" + style, ms=3, label=label)
    along.set(xscale="log", ylim=(0, 1), xlabel="distance in the pass, m", ylabel="correlation")
    along.legend(frameon=False)
    rows = numbers["standing"]
    still.plot([row["apart_s"] for row in rows], [row["spread_db"] for row in rows], "o-")
    still.set(xscale="log", ylim=(0, 2), xlabel="time apart while standing, s")
    still.set_ylabel("spread of the difference / √2, dB")
    _write(figure, "correlation")


def draw_tails(laid: list[Laid]) -> None:
    """Quantiles of the residuals against the normal's."""
    figure, (every, after) = _figure(2)
    chance = np.concatenate([np.geomspace(1e-4, 0.1, 20), np.linspace(0.12, 0.5, 15)])
    chance = np.concatenate([chance, 1.0 - chance[::-1]])
    normal = norm.ppf(chance)
    for axes, z, title in (
        (every, measures.standardised(laid, within_pass=False), "over the spread said"),
        (after, measures.standardised(laid, within_pass=True), "and over their own pass's"),
    ):
        axes.plot(normal, np.quantile(z / z.std(), chance), "o", ms=3, label="residuals")
        axes.plot(normal, normal, color="0.7", lw=0.8, label="normal")
        scale = np.sqrt((5.0 - 2.0) / 5.0)
        axes.plot(normal, student.ppf(chance, 5) * scale, "--", lw=0.9, label="Student, 5 degrees")
        axes.set(xlabel="normal quantile", ylabel="residual, its own spreads", ylim=(-6, 6))
        axes.set_title(title, fontsize=8)
    every.legend(frameon=False)
    _write(figure, "tails")


def draw_offsets(told: list[tuple[str, str, float]]) -> None:
    """Every pass's mean residual in the order of time, days apart."""
    figure, (axes,) = _figure(1, width=7.0)
    day = [when[:10] for when, _, _ in told]
    starts = [i for i in range(len(day)) if i == 0 or day[i] != day[i - 1]]
    for start in starts:
        axes.axvline(start - 0.5, color="0.85", lw=0.7)
        axes.text(start, 5.2, day[start][8:], fontsize=7, color="0.4")
    axes.axhline(0.0, color="0.6", lw=0.7)
    axes.plot([offset_db for _, _, offset_db in told], "o", ms=3)
    axes.set(xlabel="survey passes in the order of time; days of the month", ylim=(-6.5, 6))
    axes.set_ylabel("mean residual, dB")
    _write(figure, "offsets")


def draw_hearing(numbers: dict) -> None:
    """Reliability of the hearing probability, as passes heard and as the map serves it."""
    figure, axes = _figure(2)
    titles = ("share of the map's passes", "what the map serves")
    for one, name, title in zip(axes, ("hearing_share", "hearing_served"), titles, strict=True):
        one.plot([0, 1], [0, 1], color="0.7", lw=0.8)
        for (low, high), table in zip(measures.BY, numbers[name], strict=True):
            label = f"{low} pass by" if low == high else f"{low} to {high} passes by"
            said, true = [row["said"] for row in table], [row["true"] for row in table]
            one.plot(said, true, "o-", ms=3, label=label)
        one.set(xlabel="probability of hearing", ylabel="heard", xlim=(0, 1), ylim=(0, 1))
        one.set_title(title, fontsize=8)
    axes[0].legend(frameon=False)
    _write(figure, "hearing")


def draw_information(answers: list[Answers], told: dict[str, float]) -> None:
    """Which temperature makes truths most probable, and the information that it stands for."""
    figure, (curves, line) = _figure(2)
    for length_m, one in zip(LENGTHS_M, answers, strict=True):
        mean_log = one.log_truth.mean(axis=0)
        (drawn,) = curves.plot(TEMPERATURES, mean_log, lw=1.1, label=f"{length_m:.0f} m")
        best = mean_log.argmax()
        curves.plot(TEMPERATURES[best], mean_log[best], "o", ms=4, color=drawn.get_color())
        weight = one.weight.mean()
        good = TEMPERATURES[mean_log >= mean_log[best] - 0.02]
        spot = weight / TEMPERATURES[best]
        bars = [[spot - weight / good.max()], [weight / good.min() - spot]]
        line.errorbar(weight, spot, yerr=bars, fmt="o", ms=4, color=drawn.get_color())
    weight = np.linspace(1.0, 42.0, 50)
    line.plot(weight, told["once"] + told["each"] * weight, color="0.3", lw=1.0)
    line.plot(weight, weight / told["one_temperature"], "--", color="0.6", lw=1.0)
    line.set(xlabel="weight of the window's samples", ylabel="worth, independent samples")
    line.set_ylim(bottom=0.0)
    curves.set(xscale="log", xlabel="temperature", ylabel="mean log posterior at the truth")
    named = curves.get_legend_handles_labels()
    line.legend(*named, frameon=False, fontsize=7, loc="upper left", title="window")
    _write(figure, "information")


def _figure(count: int, width: float = 3.2) -> tuple[Figure, list[Axes]]:
    figure, axes = plt.subplots(
        1, count, figsize=(max(width, 2.9 * count), 2.8), layout="constrained", squeeze=False
    )
    return figure, list(axes[0])


def _write(figure: Figure, name: str) -> None:
    figure.savefig(OUT / f"{name}.png", dpi=130, metadata={"Software": None})


def _rounded(value: object) -> object:
    """Four significant digits are more than any of this holds."""
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_rounded(each) for each in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value


if __name__ == "__main__":
    main()
