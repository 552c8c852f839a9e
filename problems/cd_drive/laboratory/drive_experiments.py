"""Both experiments on one drive, one draw of each, as the problems open-loop and closed-loop do
them.
"""

from __future__ import annotations

from typing import NamedTuple

from workbench import Solution, solve
from workbench.errors import WorkbenchError
from workbench.solvers import Options
from workbench.types import Dataset

from ..drive.tables import Axis
from .closed_loop import after_open_loop
from .experiment import Laboratory
from .open_loop import open_loop


class DriveExperiments(NamedTuple):
    """Answers of both experiments, and the number of failed checks of their certificates."""

    open_loop: Dataset
    closed_loop: Dataset
    failures: int


def drive_experiments(axis: Axis, drive: str, options: Options) -> DriveExperiments:
    """The experiments on a drive ("CD1" to "CD12"). Raises WorkbenchError if one of them gives no
    answer.
    """
    current = solve(open_loop(axis, drive, draws=1), options=options)
    failures = _failures(current, drive)
    motion = solve(after_open_loop(current.answer, Laboratory(axis, drive)), options=options)
    return DriveExperiments(current.answer, motion.answer, failures + _failures(motion, drive))


def _failures(found: Solution, drive: str) -> int:
    if found.certificate is None:
        raise WorkbenchError(f"an experiment on {drive} failed: {found.message}")
    return len(found.certificate.failures)
