"""roadprint: road, sub-segment and coordinates from the cellular signal a vehicle hears."""

from __future__ import annotations

import os

# OpenBLAS reads this once, when numpy loads. Its default threads under threaded load cost 20 times
# the throughput, and no product here is large enough to gain from them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
