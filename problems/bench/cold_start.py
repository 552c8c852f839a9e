"""Time of the first answer of a new process, when nothing is compiled yet."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, problem
from workbench.executor import WALL_TIME, Context
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.types import Array, DataArray, Figure

from .bars import ratio_bars

STADIUMS = """
import workbench as wb
assert wb.run("cd/focus/stadiums").certificate.valid
"""
UPPER_BOUND = """
import numpy as np
from workbench.mu import upper_bound
from workbench.structure import Full, Real, Structure
real, imaginary = np.random.default_rng(0).standard_normal((2, 4, 4))
upper_bound(real + 1j * imaginary, Structure([Real(1), Real(1), Full(2, 2)]))
"""
CONTROLLER = """
import workbench as wb
from workbench.synthesis import MuSynthesis
from workbench.uncertainty import Parameter, generalised_plant, parametric
def lens(k):
    return [[0, 1], [-k, -2]], [[0], [100]], [[1, 0]], [[0]]
model = parametric(lens, [Parameter("k", 45.0, 0.2)], inputs="f", outputs="x")
sums = {"f": "u + d", "y": "x + n"}
signals = {"exogenous": ("d", "n"), "performance": ("x", "u")}
plant = generalised_plant([model], sums, control="u", measurement="y", **signals)
assert wb.solve(MuSynthesis(plant)).certificate.valid
"""
LIBRARIES = "import control, numba, numpy, scipy.linalg, scipy.optimize, scipy.signal"
CASES = {
    "stadiums of the CD drive": (STADIUMS, 10.0),
    "upper bound of mu": (UPPER_BOUND, 20.0),
    "robust controller": (CONTROLLER, 40.0),
}
"""Scripts that ask for a first answer, and the processor time [s] that each may take."""
IMPORTS = {"libraries": LIBRARIES, "synthesis": f"{LIBRARIES}\nimport workbench.synthesis"}
IMPORT_WANTED = 0.2
"""Largest processor time [s] of importing `workbench.synthesis`, beyond that of the libraries."""
CLOCK = """
import sys, time
print(time.process_time(), file=sys.stderr)
"""
START = ("cold", "warm")
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS")


@problem("bench/cold-start", slow=True)
def cold_start(rounds: Annotated[int, Field(ge=1, le=20)] = 3) -> ColdStart:
    """Processor time of first answers in a new process, with and without compiled code on disk.

    The time is that of this machine, which the run's record names. The limits are for a machine of
    2020 or later without other load; a loaded machine takes up to twice as long.

    rounds: number of warm starts and of imports; the shortest time of each counts.
    """
    return ColdStart(rounds)


@dataclass(frozen=True)
class ColdStart(Study):
    """Processor times of processes that answer one question and end."""

    rounds: int

    headline: ClassVar[str] = "robust_controller"

    @property
    def quantifier(self) -> str:
        return "for these questions, on this machine"

    case = dim(*CASES)
    start = dim(*START)

    @part
    def measured(self, context: Context) -> tuple[Array, Array]:
        """Processor times [s] (case, start), and that of the import beyond the libraries (1,)."""
        times = np.empty((len(CASES), len(START)))
        for row, (script, _) in zip(times, context.track(CASES.values(), "cases"), strict=True):
            with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
                row[0] = _processor_time(script, Path(folder))
                row[1] = min(_processor_time(script, Path(folder)) for _ in range(self.rounds))
        with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            least = {
                name: min(_processor_time(script, Path(folder)) for _ in range(self.rounds + 1))
                for name, script in IMPORTS.items()
            }
        return times, np.array(least["synthesis"] - least["libraries"])

    seconds = array(
        dims=(case, start),
        unit="s",
        meaning="time",
        value=lambda measured: measured[0],
        **WALL_TIME,
    )
    import_time = array(
        dims=(), unit="s", meaning="time", value=lambda measured: measured[1], **WALL_TIME
    )

    @check()
    def soon_enough(self, seconds: DataArray, import_time: DataArray) -> list[Check]:
        checks = [
            Check(case, "processor time [s]", float(seconds.sel(case=case, start="cold")), wanted)
            for case, (_, wanted) in CASES.items()
        ]
        return [*checks, Check("import", "processor time [s]", float(import_time), IMPORT_WANTED)]

    first_answers = metric(
        template="{case}", value=lambda seconds: seconds.sel(start="cold", drop=True)
    )

    @figure
    def times(self, seconds: DataArray) -> Figure:
        cold = {case: float(seconds.sel(case=case, start="cold")) for case in CASES}
        wanted = [limit for _, limit in CASES.values()]
        return ratio_bars(cold, "processor time of the first answer [s]", wanted)

    @table
    def starts(
        self, seconds: DataArray, import_time: DataArray
    ) -> tuple[list[str], list[list[str]]]:
        rows = []
        for case, (_, wanted) in CASES.items():
            measured = [f"{float(seconds.sel(case=case, start=one)):.1f}" for one in START]
            rows.append([case, *measured, f"{wanted:g}"])
        rows.append(["import of synthesis", "", f"{float(import_time):.2f}", f"{IMPORT_WANTED:g}"])
        return ["first answer", "cold [s]", "warm [s]", "asked [s]"], rows


def _processor_time(script: str, folder: Path) -> float:
    """Processor time [s] of a single-threaded process that runs a script.

    Code is compiled into the folder. An empty folder makes the start cold.
    """
    environment = (
        os.environ | dict.fromkeys(THREADS, "1") | {"NUMBA_CACHE_DIR": str(folder / "code")}
    )
    done = subprocess.run(
        [sys.executable, "-c", script + CLOCK],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"the first answer failed: {done.stderr[-500:]}")
    return float(done.stderr.splitlines()[-1])
