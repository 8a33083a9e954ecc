"""The compared methods: one interface, one file each, built from the same surveys."""

from __future__ import annotations

from typing import cast

from app.evaluation.methods import cfels, exhaustive, gift, paper, roadprint, rwknn
from app.evaluation.methods.base import Confident, Estimate, Method, Model, Place, Previous, Survey

METHODS: dict[str, Method] = {
    module.name: cast("Method", module)
    for module in (paper, rwknn, gift, cfels, exhaustive, roadprint)
}
"""Name -> method, in the order of reports."""

__all__ = ["METHODS", "Confident", "Estimate", "Method", "Model", "Place", "Previous", "Survey"]
