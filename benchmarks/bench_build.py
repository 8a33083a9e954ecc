"""
A map built by the service as a user runs it: 17 real streets, or as many simulated ones.

Starts the service with its own worker on an empty folder, imports the survey without building, then
times one build of all roads from the request to its success. Ends by itself.

    python -m benchmarks.bench_build [--data DIR] [--repeat 1]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median

import httpx

from app.evaluation.dataset import is_dataset
from benchmarks.bench_http import free_port, running

ROOT = Path(__file__).resolve().parents[1]
REAL = ROOT.parent / "shared" / "data" / "santa_monica_att"
POLL_S = 0.2
LONGEST_S = 600.0


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=REAL, help="data set folder to import")
    parser.add_argument("--repeat", type=int, default=1)
    chosen = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="roadprint-bench-") as name:
        folder = Path(name)
        data = chosen.data if is_dataset(chosen.data) else simulated(folder)
        times = [one_build(data, folder / f"store-{turn}") for turn in range(chosen.repeat)]
    print(f"build of {data.name}: {os.cpu_count()} cores, one worker")
    print(f"  wall time {median(times):.1f} s   all runs {', '.join(f'{t:.1f}' for t in times)}")


def simulated(folder: Path) -> Path:
    """A city's survey where the measurements are absent."""
    data = folder / "city"
    command = [sys.executable, "-m", "app", "simulate", "--scenario", "city", "--out", str(data)]
    subprocess.run([*command, "--seed", "7", "--roads", "17"], cwd=ROOT, check=True)
    return data


def one_build(data: Path, store: Path) -> float:
    """Seconds from the build's request to its success."""
    port = free_port()
    serve = [sys.executable, "-m", "app", "serve", "--data", str(store), "--port", str(port)]
    with running(serve, f"http://127.0.0.1:{port}") as url:
        command = [sys.executable, "-m", "app", "import", str(data), "--url", url, "--no-build"]
        subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        started = time.perf_counter()
        build = httpx.post(f"{url}/v1/builds", json={}).raise_for_status().json()
        while time.perf_counter() - started < LONGEST_S:
            state = httpx.get(f"{url}/v1/builds/{build['id']}").raise_for_status().json()
            if state["status"] == "successful":
                return time.perf_counter() - started
            if state["status"] in {"failed", "dismissed"}:
                raise RuntimeError(f"the build ended as {state['status']}: {state['problem']}")
            time.sleep(POLL_S)
        raise TimeoutError(f"the build took more than {LONGEST_S:.0f} s")


if __name__ == "__main__":
    main()
