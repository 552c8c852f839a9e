"""A research workbench for optimisation-centric robust control.

Named problems, any solver, every answer certified from the data alone, every run a results folder.
Nothing heavy is imported until it is used.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from workbench._core.on_demand import on_demand

__version__ = "0.3.0"

IMPORT_TIME = time.time_ns()
"""Time at which this process imported the workbench [ns since the epoch], before any plant's
module.
"""

if TYPE_CHECKING:
    from workbench import certificate as certificate
    from workbench import certify as certify
    from workbench import collections as collections
    from workbench import conic as conic
    from workbench import diagnosis as diagnosis
    from workbench import errors as errors
    from workbench import executor as executor
    from workbench import figures as figures
    from workbench import fitting as fitting
    from workbench import geometry as geometry
    from workbench import identification as identification
    from workbench import mu as mu
    from workbench import optics as optics
    from workbench import program as program
    from workbench import realisations as realisations
    from workbench import simulation as simulation
    from workbench import solvers as solvers
    from workbench import starter as starter
    from workbench import structure as structure
    from workbench import study as study
    from workbench import synthesis as synthesis
    from workbench import systems as systems
    from workbench import types as types
    from workbench import uncertainty as uncertainty
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
else:
    __getattr__, __dir__ = on_demand(__name__)

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
