"""From an explanation to the document that clients read."""

from __future__ import annotations

from typing import Any

import numpy as np

from app.domain import FEATURE_KINDS, FEATURE_UNITS, Fix, Window
from app.numerics.explanation import Account, CellShare, Explanation, explain
from app.numerics.index import MapIndex
from app.numerics.lines import point_at
from app.numerics.wording import expected_share, sentences

Document = dict[str, Any]


def explanation_document(index: MapIndex, window: Window, fix: Fix) -> Document:
    """An `ExplanationDocument` of a window's fix."""
    told = explain(index, window, fix)
    return {
        "words": sentences(told, fix),
        "answer": _place(index, told.answer),
        "runner_up": _place(index, told.runner_up),
        "score_difference": told.difference,
        "temperature": told.temperature,
        "device_offset_db": told.answer.told.device_db,
        "offset_contribution": told.offset,
        "cells": [_cell(told, one) for one in told.shares],
        "fit": told.fit,
        "any_road": told.any_road,
        "this_road": told.this_road,
        "noise": told.noise,
        "silence": told.silence,
        "left_out": [one._asdict() for one in told.left_out],
        "unlisted": told.unlisted,
        "samples": _samples(told),
        "not_heard": [
            {"cell": cell, "hearing": hearing, "contribution": told.answer.told.silent[cell]}
            for cell, hearing in told.missing.items()
        ],
        "reference_cell": told.reference,
        "features": {
            kind: _feature(told, row, unit)
            for row, (kind, unit) in enumerate(zip(FEATURE_KINDS, FEATURE_UNITS, strict=True))
        },
    }


def _place(index: MapIndex, account: Account) -> Document:
    spot = point_at(index.lines[account.place.road], account.place.chainage_m)
    return {
        "road_id": account.road_id,
        "segment_index": account.segment,
        "direction": account.direction,
        "chainage_m": account.place.chainage_m,
        "lon": float(spot.lon),
        "lat": float(spot.lat),
        "score": account.told.score,
        "samples_outside": account.outside,
    }


def _cell(told: Explanation, one: CellShare) -> Document:
    known = one.cell in told.cells
    heard = ~np.isnan(told.rsrp_dbm[:, told.cells.index(one.cell)]) if known else np.zeros(1)
    return {
        "cell": one.cell,
        "level": one.level,
        "hearing": one.hearing,
        "total": one.total,
        "heard": float(heard.mean()),
        "answer_hearing": expected_share(told, told.answer, one.cell),
        "runner_up_hearing": expected_share(told, told.runner_up, one.cell),
        "answer_residual_db": _mean_residual_db(told, told.answer, one.cell),
        "runner_up_residual_db": _mean_residual_db(told, told.runner_up, one.cell),
    }


def _mean_residual_db(told: Explanation, account: Account, cell: str) -> float | None:
    if cell not in told.cells:
        return None
    column = told.residual_at(account)[:, told.cells.index(cell)]
    known = column[~np.isnan(column)]
    return float(known.mean()) if known.size else None


def _samples(told: Explanation) -> Document:
    expected = told.answer.expected
    return {
        "cells": told.cells,
        "behind_m": np.ascontiguousarray(told.behind_m),
        "offset_db": np.ascontiguousarray(told.answer.told.offset_db),
        "residual_db": np.ascontiguousarray(told.residual_db),
        "expected_dbm": np.ascontiguousarray(expected.rsrp_dbm),
        "spread_db": np.ascontiguousarray(expected.spread_db),
        "hearing": np.ascontiguousarray(expected.hearing),
    }


def _feature(told: Explanation, row: int, unit: str) -> Document:
    answer, rival = told.answer, told.runner_up
    return {
        "unit": unit,
        "window": np.ascontiguousarray(told.features[row]),
        "answer": np.ascontiguousarray(answer.features[row]),
        "runner_up": np.ascontiguousarray(rival.features[row]),
        "closer": _closer(told, row),
        "answer_road_mask": answer.road_mask[row].tolist(),
        "answer_segment_mask": answer.segment_mask[row].tolist(),
        "runner_up_road_mask": rival.road_mask[row].tolist(),
        "runner_up_segment_mask": rival.segment_mask[row].tolist(),
    }


def _closer(told: Explanation, row: int) -> list[str | None]:
    """Whose prediction of a feature is nearer to the window's own, cell by cell."""
    misses = [
        np.abs(one.features[row] - told.features[row]).tolist()
        for one in (told.answer, told.runner_up)
    ]
    said: list[str | None] = []
    for here, there in zip(*misses, strict=True):
        nearer = "answer" if here < there else "runner_up" if there < here else None
        said.append(nearer)  # NaN is neither less nor more
    return said
