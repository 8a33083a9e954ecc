"""`roadprint demo`, the first thing that anybody runs."""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path

import httpx
import orjson
import pytest

from .conftest import running_service

pytestmark = pytest.mark.end_to_end


def demo(folder: Path, *words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "app", "demo", "--data", str(folder), *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=180, check=False)


def test_the_demo_ends_well_and_leaves_a_map_that_can_be_served(tmp_path):
    """On a taken port too: table, exit code 0, and the same map and window served afterwards."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = demo(tmp_path / "data", "--windows", 40, "--port", port)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"port {port} is taken" in done.stdout
    for figure in ("mean distance error", "road right", "direction right", "delay, end to end"):
        assert figure in done.stdout
    with running_service(tmp_path / "data") as url:
        window = orjson.loads((tmp_path / "data" / "window.json").read_bytes())
        fix = httpx.post(f"{url}/v1/locate", json=window).json()
        assert fix["status"] == "located"
        assert len(httpx.get(f"{url}/v1/roads").json()["roads"]) == 4
    again = demo(tmp_path / "data", "--windows", 5, "--port", 0)
    assert again.returncode == 0, again.stdout + again.stderr


def test_the_demo_empties_no_folder_of_others(tmp_path):
    """Somebody's files stay, and the message says what to do."""
    (tmp_path / "thesis.txt").write_text("mine")
    done = demo(tmp_path)
    assert done.returncode == 1
    assert "--data" in done.stderr
    assert (tmp_path / "thesis.txt").read_text() == "mine"
