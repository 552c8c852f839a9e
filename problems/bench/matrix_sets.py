"""Speed of the smallest sets that contain matrices, against a semidefinite program
per frequency.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import problem, solve
from workbench.errors import SolverError
from workbench.executor import WALL_TIME, Context
from workbench.study import Study, array, check, dim, figure, metric, part
from workbench.types import DataArray, Figure
from workbench.uncertainty.matrix_covers.sets.program import MatrixSets

from .bars import ratio_bars

METHODS = {
    "barrier": "Newton's method along geodesics, all frequencies at once",
    "clarabel": "a compiled semidefinite program for each frequency",
}
"""Timed methods, with their labels in the figure."""
LEAST_RATIO = 4.0
"""Least speed of the barrier method, relative to the peer's."""
APART = 1e-6
"""Largest accepted difference of the two methods' sizes, as a natural logarithm of their ratio."""


@problem("bench/matrix-sets")
def matrix_sets(
    frequencies: Annotated[int, Field(ge=2)] = 60,
    plants: Annotated[int, Field(ge=2)] = 20,
    channels: Annotated[int, Field(ge=1, le=6)] = 2,
) -> MatrixSetSpeed:
    """Speed of the smallest sets that contain matrices, on one task for two methods.

    Both methods minimise the traces, with diagonal weights. The peer's program is compiled once,
    with the matrices as parameters.

    frequencies, plants, channels: size of the task. The matrices are drawn at random.
    """
    return MatrixSetSpeed(frequencies, plants, channels)


@dataclass(frozen=True)
class MatrixSetSpeed(Study):
    """Processor times of two methods on the same matrices, in one run."""

    frequencies: int
    plants: int
    channels: int

    headline: ClassVar[str] = "barrier_over_clarabel"

    @property
    def quantifier(self) -> str:
        return "in this one run, on this machine"

    @part
    def found(self, context: Context) -> list[tuple[float, np.ndarray]]:
        """Processor time [s] and sizes (F,) of each method."""
        shape = (self.frequencies, self.plants, self.channels, self.channels)
        drawn = context.rng.normal(size=(2, *shape))
        program = MatrixSets(
            drawn[0] + 1j * drawn[1], left="diagonal", right="diagonal", size="trace"
        )
        results = []
        for method in METHODS:
            start = time.process_time()
            solution = solve(program, method=method, options=context.options)
            seconds = time.process_time() - start
            if solution.certificate is None or not solution.certificate.valid:
                raise SolverError(f"{method}: {solution.message}")
            results.append((seconds, program.sizes(solution.answer)))
        return results

    solver = dim(METHODS)
    frequency = dim(lambda found: np.arange(found[0][1].size))
    seconds = array(
        dims=solver, unit="s", value=lambda found: [each[0] for each in found], **WALL_TIME
    )
    size = array(
        dims=(solver, frequency), unit="1", value=lambda found: [each[1] for each in found]
    )

    agree = check(
        title="methods agree",
        statement="distance of the sizes of the two methods, in logarithms",
        value=lambda size: abs(np.log(size / size.isel(solver=0))).max(),
        at_most=APART,
    )
    slow = check(
        title="barrier over clarabel",
        statement=f"time over the peer's, at most {1 / LEAST_RATIO:.3g}",
        value=lambda seconds: _ratio(seconds),
        at_most=1 / LEAST_RATIO,
    )
    barrier_over_clarabel = metric(lambda seconds: _ratio(seconds))

    @figure
    def ratios(self, seconds: DataArray) -> Figure:
        bars = {text: 1 / _ratio(seconds, name) for name, text in METHODS.items()}
        return ratio_bars(bars, "time over that of the barrier method, in one run")


def _ratio(seconds: DataArray, other: str = "clarabel") -> float:
    """Time of the barrier method, divided by another method's."""
    return float(seconds.sel(solver="barrier") / seconds.sel(solver=other))
