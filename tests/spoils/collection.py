"""A small problem of every Program of the library, and its certified answer."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import control
import numpy as np

import workbench as wb
from workbench.program import Program
from workbench.synthesis import LoopShaping, MixedSensitivity
from workbench.uncertainty import MatrixCover, MatrixModel, feedback

MUTANTS = Path(__file__).parents[1] / "mutants"
if str(MUTANTS) not in sys.path:
    sys.path.append(str(MUTANTS))

from small_problems import OTHERS  # noqa: E402
from tight_problems import PROGRAMS as TIGHT  # noqa: E402
from tight_problems import QUICK_METHODS  # noqa: E402


def loop_shaping() -> Program:
    """An integrator, shaped as it is."""
    return LoopShaping(control.tf([1.0], [1.0, 0.0]))


def mixed_sensitivity() -> Program:
    """A lag with weights of its sensitivity and its control."""
    return MixedSensitivity(
        control.tf([1.0], [1.0, 1.0]), W_S=control.tf([0.1, 1.0], [1.0, 0.01]), W_KS=0.5
    )


def cover_for_loop() -> Program:
    """The plants of `matrix_cover` in a loop with a gain."""
    cover = TIGHT["matrix_cover"]()
    K = control.ss([], [], [], 0.2 * np.eye(2))
    open_loop = MatrixModel.unweighted(cover.nominal, form="additive")
    return MatrixCover(
        cover.responses,
        cover.nominal,
        loop=feedback(np.eye(2), open_loop * K),
        left_order=1,
        right_order=0,
    )


PROGRAMS = {
    **OTHERS,
    **TIGHT,
    **{make.__name__: make for make in (loop_shaping, mixed_sensitivity, cover_for_loop)},
}


class Solved(NamedTuple):
    """A program, its certified answer, and the method that gave it."""

    program: Program
    answer: Any
    method: str | None


@cache
def solved(name: str) -> Solved:
    """The program of that name and its answer, found once."""
    program, method = PROGRAMS[name](), QUICK_METHODS.get(name)
    solution = wb.solve(program, method=method)
    assert solution.certificate is not None and solution.certificate.holds, solution
    return Solved(program, solution.answer, method)
