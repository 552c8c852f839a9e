"""A research workbench for optimisation-centric robust control.

Named problems, any solver, every answer certified from the data alone, every run a results folder.
Nothing heavy is imported until it is used.
"""

from __future__ import annotations

import importlib
import time
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

IMPORT_TIME = time.time_ns()
"""When this process imported the workbench [ns since the epoch], before any plant's module."""

if TYPE_CHECKING:
    from workbench.api import compare, connect, load, problems, results, run, sweep, verify
    from workbench.bench.declare import problem, ref
    from workbench.bench.project import add_problems
    from workbench.bench.report import report
    from workbench.bench.results import Run, open_run
    from workbench.certificate import Certificate, Check
    from workbench.geometry import narrowest_stadium, smallest_area_stadium, smallest_circle
    from workbench.program import Program, method
    from workbench.solution import Solution, solve
    from workbench.solvers import Options, Outcome
    from workbench.study import Study

_HOME = {
    "workbench.api": (
        "compare",
        "connect",
        "load",
        "problems",
        "results",
        "run",
        "sweep",
        "verify",
    ),
    "workbench.bench.project": ("add_problems",),
    "workbench.bench.declare": ("problem", "ref"),
    "workbench.bench.report": ("report",),
    "workbench.bench.results": ("Run", "open_run"),
    "workbench.geometry": ("narrowest_stadium", "smallest_area_stadium", "smallest_circle"),
    "workbench.certificate": ("Certificate", "Check"),
    "workbench.program": ("Program", "method"),
    "workbench.solution": ("Solution", "solve"),
    "workbench.solvers": ("Options", "Outcome"),
    "workbench.study": ("Study",),
}
_MODULE = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "Certificate",
    "Check",
    "Options",
    "Outcome",
    "Program",
    "Run",
    "Solution",
    "Study",
    "__version__",
    "add_problems",
    "compare",
    "connect",
    "load",
    "method",
    "narrowest_stadium",
    "open_run",
    "problem",
    "problems",
    "ref",
    "report",
    "results",
    "run",
    "smallest_area_stadium",
    "smallest_circle",
    "solve",
    "sweep",
    "verify",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE:
        raise AttributeError(f"module 'workbench' has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULE[name]), name)


def __dir__() -> list[str]:
    return __all__
