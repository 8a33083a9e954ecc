"""A serving process stays small: what only builds need is not loaded."""

from __future__ import annotations

import subprocess
import sys

import pytest

BUILD_ONLY = (
    *("scipy", "ruptures", "shapely", "pyproj", "pandas", "pyarrow", "matplotlib", "dbos"),
    "alembic",
)


@pytest.mark.parametrize("module", ["app.main", "app.commands.serve"])
def test_serving_loads_nothing_that_only_builds_need(module: str):
    """Half the start-up time and half the memory are at stake."""
    program = f"import sys, {module}; print(*sorted(set({BUILD_ONLY}) & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.split() == []


def test_blas_is_held_to_one_thread():
    """OpenBLAS reads its setting when numpy loads, so importing the package comes first."""
    program = (
        "import os, app; os.environ['OPENBLAS_NUM_THREADS'] == '1' or exit(1);"
        "import app.main, numpy, threading; exit(threading.active_count() != 1)"
    )
    environment = {"PATH": "", "OPENBLAS_NUM_THREADS": ""}
    del environment["OPENBLAS_NUM_THREADS"]
    done = subprocess.run([sys.executable, "-c", program], env=environment, check=False, timeout=60)
    assert done.returncode == 0
