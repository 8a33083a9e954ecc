"""What is installed is locked, CI and container say the Makefile's words, files stay small."""

from __future__ import annotations

import re
import subprocess
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import app

ROOT = Path(__file__).resolve().parents[2]
MAX_LINES = 300
TOP_LEVEL = {
    *("app", "migrations", "tests", "openapi", "benchmarks", "docs"),
    *("Dockerfile", "Makefile", "README.md", "CHANGELOG.md", "pyproject.toml", "setup.py"),
    "constraints.txt",
}


def pins() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pairs = (line.split("==") for line in lines if line and not line.startswith("#"))
    return {canonicalize_name(name): version for name, version in pairs}


def needed() -> set[str]:
    """Everything that `make install` brings in beside roadprint itself."""
    waiting = [("roadprint", frozenset({"dev"}))]
    seen = set(waiting)
    while waiting:
        name, extras = waiting.pop()
        for requirement in map(Requirement, distribution(name).requires or []):
            marker = requirement.marker
            wanted = marker is None or any(
                marker.evaluate({"extra": extra}) for extra in extras | {""}
            )
            found = (canonicalize_name(requirement.name), frozenset(requirement.extras))
            if wanted and found not in seen:
                seen.add(found)
                waiting.append(found)
    return {name for name, _ in seen} - {"roadprint"}


def test_every_dependency_is_locked_to_what_is_installed():
    """Direct or not, runtime or for development: one exact version, and that one is here."""
    locked = pins()
    for name in sorted(needed()):
        assert name in locked, f"{name} is not in constraints.txt"
        assert distribution(name).version == locked[name], name


def test_nothing_is_locked_that_is_not_needed():
    """Left-over pins would be taken for dependencies."""
    assert set(pins()) <= needed()


def test_constraints_name_no_address():
    """Names and versions only: where packages come from is the machine's affair."""
    text = (ROOT / "constraints.txt").read_text()
    assert "://" not in text
    assert "@" not in text


def test_ci_says_the_makefiles_words():
    """CI runs what a developer runs, the tests among it."""
    script = (ROOT / ".ci" / "run").read_text()
    words = re.findall(r"^make (\w+)", script, re.MULTILINE)
    assert words == ["install", "lint", "types", "contracts", "test", "demo"]


@pytest.mark.parametrize("script", ["run", "setup"])
def test_shell_scripts_parse(script):
    """Bash finds no fault in them."""
    done = subprocess.run(["bash", "-n", ROOT / ".ci" / script], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_container_is_made_and_run_as_here():
    """It installs by `make install`, serves by `roadprint serve`, not as root, and is watched."""
    text = (ROOT / "Dockerfile").read_text()
    assert len(re.findall(r"^FROM ", text, re.MULTILINE)) == 2
    assert "make install" in text
    assert '"roadprint", "serve"' in text
    assert re.search(r"^USER [1-9]\d*", text, re.MULTILINE)
    assert "HEALTHCHECK" in text
    assert "/livez" in text


def test_files_stay_small():
    """No module grows beyond what one reads in one go."""
    paths = [
        path for room in ("app", "tests", "benchmarks") for path in (ROOT / room).rglob("*.py")
    ]
    long = {path.name: count for path in paths if (count := line_count(path)) > MAX_LINES}
    assert not long


def line_count(path: Path) -> int:
    return len(path.read_text().splitlines())


def test_the_top_level_is_as_agreed():
    """Tracked files lie in the known rooms."""
    done = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        pytest.skip("this is no git checkout")
    top = {line.partition("/")[0] for line in done.stdout.splitlines()}
    assert {name for name in top if not name.startswith(".")} <= TOP_LEVEL


def test_the_package_is_installed_from_here():
    """What the tests import is this checkout, not another one."""
    assert Path(app.__file__).parent == ROOT / "app"
