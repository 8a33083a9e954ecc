"""Columns of a road model's evidence: one row a held-out window."""

from __future__ import annotations

from itertools import product

import numpy as np

TEMPERATURES = tuple(float(t) for t in np.round(np.geomspace(0.08, 12.0, 16), 3))
POSITION_SDS_M = (0.0, 1.0, 2.0, 3.0, 4.5, 6.0, 8.0, 11.0)
CHOICES = tuple(product(TEMPERATURES, POSITION_SDS_M))
FIXED_COLUMNS = (
    "fit",  # best score on the road per independent reading
    "offset_db",  # device offset at the truth
    "offset_variance_db2",  # what the window's own noise puts into it
    "measured",  # 1 = a real pass, 0 = drawn from the model
)
# Log of the posterior per metre at the truth, for each temperature and error of the truth itself.
COLUMNS = FIXED_COLUMNS + tuple(f"log_density_at_{t}_{sd}m" for t, sd in CHOICES)
