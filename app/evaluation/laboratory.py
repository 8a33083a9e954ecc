"""Run jobs and report on them: the door to what needs the `evaluation` extra."""

from app.evaluation.experiments.execute import execute, weight
from app.evaluation.report.write import Run, write_report

__all__ = ["Run", "execute", "weight", "write_report"]
