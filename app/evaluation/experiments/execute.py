"""Jobs over processes: resumable, and the same numbers however many processes there are."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from app.evaluation.experiments.plan import Job
from app.evaluation.experiments.run import run_job
from app.evaluation.experiments.tables import Shelf

Told = Callable[[int], None]
"""Hears how many windows were asked since it was last told."""


def execute(wanted: Sequence[Job], folder: Path, processes: int, told: Told) -> None:
    """
    Run what the folder lacks.

    Processes are started anew, not forked, so that each sets up its own threads of arithmetic:
    the caller says how many by the environment (one, or delays mean nothing).
    """
    shelf = Shelf(folder)
    missing = []
    for job in wanted:
        if shelf.has(job):
            told(weight(job))
        else:
            missing.append(job)
    if not missing:
        return
    missing.sort(key=_work, reverse=True)  # the longest first: no process is left alone at the end
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(finish, job, folder): job for job in missing}
        for done in as_completed(running):
            done.result()
            told(weight(running[done]))


def finish(job: Job, folder: Path) -> None:
    """Run one job and keep it."""
    Shelf(folder).put(job, run_job(job, time.perf_counter))


def weight(job: Job) -> int:
    """Windows asked: what the progress bar counts."""
    return job.setting.windows * len(job.cases)


def _work(job: Job) -> tuple[int, int]:
    """What takes longest to run: large cities, then many windows."""
    roads = job.setting.scenario.roads if job.setting.scenario is not None else 0
    return roads, weight(job)
