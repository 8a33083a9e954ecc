"""
Resident memory of a serving process with the paper's area loaded, and its time to the first answer.

    python -m benchmarks.bench_memory
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import httpx

from benchmarks.bench_http import free_port, paper_area

ROOT = Path(__file__).resolve().parents[1]
REQUESTS = 500
START_S = 30.0


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory(prefix="roadprint-bench-") as name:
        bodies = paper_area(Path(name))
        port = free_port()
        command = [sys.executable, "-m", "app", "serve", "--data", name, "--port", str(port)]
        started = time.perf_counter()
        process = subprocess.Popen([*command, "--no-worker"], cwd=ROOT, stdout=subprocess.DEVNULL)
        try:
            url = f"http://127.0.0.1:{port}/v1/locate"
            first_s = time_to_first_answer(url, bodies[0], started)
            with httpx.Client() as client:
                for turn in range(REQUESTS):
                    client.post(url, content=bodies[turn % len(bodies)], headers=JSON)
            print(f"serving process, paper's area, after {REQUESTS} fixes")
            print(f"  resident            {resident_mb(process.pid):6.0f} MB")
            print(f"  start to first fix  {first_s:6.2f} s")
        finally:
            process.terminate()
            process.wait(10)


JSON = {"content-type": "application/json"}


def time_to_first_answer(url: str, body: bytes, started: float) -> float:
    """Seconds from the start of the process to its first fix."""
    while time.perf_counter() - started < START_S:
        try:
            answer = httpx.post(url, content=body, headers=JSON)
        except httpx.TransportError:
            time.sleep(0.02)
            continue
        if answer.status_code == httpx.codes.OK:
            return time.perf_counter() - started
        time.sleep(0.02)
    raise TimeoutError(f"no fix within {START_S:.0f} s")


def resident_mb(pid: int) -> float:
    """Resident set of a process, megabytes."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return float(line.split()[1]) / 1024.0
    raise RuntimeError(f"process {pid} says nothing of its memory")


if __name__ == "__main__":
    main()
