"""One self-contained HTML page, readable from top to bottom."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from app.evaluation.experiments.score import Row
from app.evaluation.report.verdict import Finding

STYLE = """
body{font:16px/1.5 system-ui,sans-serif;max-width:84rem;margin:2rem auto;padding:0 1rem;color:#222}
h1{font-size:1.7rem}h2{margin-top:2.5rem;border-top:1px solid #ddd;padding-top:1rem}
p,ul{max-width:62rem}svg{max-height:30rem}
table{border-collapse:collapse;font-size:.8rem;margin:1rem 0;font-variant-numeric:tabular-nums}
.wide{overflow-x:auto}
th,td{padding:.2rem .5rem;text-align:right;border-bottom:1px solid #eee;white-space:nowrap}
th:first-child,td:first-child,th.text,td.text{text-align:left}
tr.ours{background:#fdeeee}svg{max-width:100%;height:auto}
.no{color:#a11}.yes{color:#161}p.note{color:#555;font-size:.9rem}
"""

COLUMNS: tuple[tuple[str, str, str], ...] = (
    ("protocol", "protocol", ""),
    ("label", "at", ""),
    ("method", "method", ""),
    ("windows", "windows", "d"),
    ("mde_m", "MDE m", ".2f"),
    ("interval", "95 % interval", ""),
    ("median_m", "median m", ".2f"),
    ("p75_m", "p75", ".2f"),
    ("p90_m", "p90", ".2f"),
    ("p95_m", "p95", ".2f"),
    ("median_along_m", "median along", ".2f"),
    ("bound_m", "bound m", ".3f"),
    ("road_rate", "road", ".1%"),
    ("direction_rate", "direction", ".1%"),
    ("direction_given_road_rate", "direction on the right road", ".1%"),
    ("median_delay_ms", "median ms", ".3f"),
    ("mean_delay_ms", "mean ms", ".3f"),
)


def text(value: Any, form: str) -> str:
    """A number in its form; a dash where there is none."""
    if value is None:
        return "–"
    return format(value, form) if form else str(value)


def score_table(rows: Sequence[Row]) -> str:
    """Every figure of every point."""
    head = [(name, title) for name, title, _ in COLUMNS]
    cells = [
        {name: text(_with_interval(row).get(name), form) for name, _, form in COLUMNS}
        for row in rows
    ]
    return table(head, cells)


def _with_interval(row: Row) -> Row:
    return row | {"interval": f"{row['mde_low_m']:.2f} to {row['mde_high_m']:.2f}"}


def table(head: Sequence[tuple[str, str]], rows: Sequence[dict[str, str]]) -> str:
    """A table of texts; rows of roadprint stand out."""
    top = "".join(f"<th>{escape(title)}</th>" for _, title in head)
    body = []
    for row in rows:
        ours = ' class="ours"' if row.get("method") == "roadprint" else ""
        cells = "".join(f"<td>{escape(row.get(name, ''))}</td>" for name, _ in head)
        body.append(f"<tr{ours}>{cells}</tr>")
    return f'<div class="wide"><table><tr>{top}</tr>{"".join(body)}</table></div>'


def verdict(findings: Sequence[Finding]) -> str:
    """First where roadprint does not win, then how often it does."""
    lost = [each for each in findings if not each.wins]
    won = len(findings) - len(lost)
    if not findings:
        return "<p>roadprint was not among the methods: there is no verdict.</p>"
    head = (
        f"<p>Compared with every method that reaches 95 % of its road rate, roadprint has the "
        f"lowest figure in <b class='yes'>{won} of {len(findings)}</b> comparisons "
        f"(MDE, median error and median delay at every point).</p>"
    )
    if not lost:
        return head + "<p>There is none that it loses.</p>"
    items = "".join(f'<li class="no">{escape(each.text)}</li>' for each in lost)
    return f"{head}<p>Where it does <b>not</b> win:</p><ul>{items}</ul>"


def page(title: str, parts: Sequence[str]) -> str:
    """The whole document."""
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{escape(title)}</title><style>{STYLE}</style><h1>{escape(title)}</h1>"
        + "".join(parts)
        + "</html>\n"
    )
