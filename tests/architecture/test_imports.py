"""Which room may import which, and what a process loads: held by running it, not by reading it."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

FRAMEWORKS = ("fastapi", "starlette", "pydantic", "sqlalchemy", "alembic", "dbos", "httpx", "typer")

# Who may look at the environment; every other room is handed what it needs.
MAY_READ_ENVIRONMENT = {
    "app/__init__.py": "holds BLAS to one thread before numpy is loaded",
    "app/cli.py": "an edge",
    "app/main.py": "an edge",
    "app/services/supervisor.py": "hands its own environment on to the worker process",
}


def python(program: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", program]
    return subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )


def modules_of(package: str) -> list[str]:
    paths = (ROOT / package.replace(".", "/")).rglob("*.py")
    names = (".".join(path.relative_to(ROOT).with_suffix("").parts) for path in paths)
    return sorted(name.removesuffix(".__init__") for name in names)


def test_imports_point_one_way():
    """The import-linter contracts of pyproject.toml hold."""
    linter = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run(
        [linter, "--no-cache"], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_numerics_run_without_any_framework():
    """Every module of app.numerics imports where no web, database or console package is there."""
    program = f"""
import importlib, sys
for name in {FRAMEWORKS}:
    sys.modules[name] = None
for name in {modules_of("app.numerics")}:
    importlib.import_module(name)
"""
    done = python(program)
    assert done.returncode == 0, done.stderr


def test_only_the_edges_read_the_environment():
    """os.environ and os.getenv appear in the console commands, the wiring and nowhere else."""
    readers = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "app").rglob("*.py")
        if reads_environment(ast.parse(path.read_text()))
    }
    strangers = {name for name in readers if not name.startswith("app/commands/")}
    assert strangers <= set(MAY_READ_ENVIRONMENT)


def reads_environment(tree: ast.Module) -> bool:
    return any(
        (
            isinstance(node, ast.Attribute)
            and node.attr in {"environ", "environb", "getenv"}
            and isinstance(node.value, ast.Name)
            and node.value.id == "os"
        )
        or (
            isinstance(node, ast.ImportFrom)
            and node.module == "os"
            and any(alias.name in {"environ", "environb", "getenv"} for alias in node.names)
        )
        for node in ast.walk(tree)
    )


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("import os\nos.environ['A']", True),
        ("import os\nos.getenv('A')", True),
        ("from os import environ", True),
        ("import os\nos.path", False),
    ],
)
def test_the_look_for_readers_sees_them(code, expected):
    """The scan itself finds every spelling."""
    assert reads_environment(ast.parse(code)) is expected
