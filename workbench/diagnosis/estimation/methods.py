"""Fault estimation by H-infinity synthesis of the nominal plant, and by mu synthesis of the set."""

from __future__ import annotations

from typing import Any

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.certify.norms import certified_norm
from workbench.diagnosis.estimation.program import FaultEstimation
from workbench.executor import Context
from workbench.program import Claim, conic_method, find_method, method
from workbench.solvers import ConicSolver
from workbench.synthesis.h_infinity.conic import LMI_ACCURACY
from workbench.synthesis.h_infinity.methods import LEVEL_ACCURACY
from workbench.synthesis.h_infinity.program import HinfSynthesis
from workbench.synthesis.mu.program import MuSynthesis

MU_METHODS = ("dk", "mu-dk", "dgk")
"""Methods of `MuSynthesis` that estimation offers under the same names."""
USELESS_FILTER_MARGIN = 2e-3
"""A filter is of no use if its norm is less than this share below the norm without a filter."""


def nominal_filter(program: FaultEstimation, context: Context, name: str) -> Claim:
    """The filter of least stacked norm on the nominal plant, by a method of `HinfSynthesis`."""
    synthesis = HinfSynthesis(program.nominal)
    found, outcome, said = find_method(synthesis, name).answer(synthesis, context)
    if found is None:
        return None, outcome, said
    without = certified_norm(_unfiltered(program))
    if found.norm > (1.0 - USELESS_FILTER_MARGIN) * without:
        said = (
            f"no filter does better than u_f = 0, whose norm is {without:.4g}: with these weights "
            f"faults cannot be told from disturbances; {said}"
        )
    return program.answer(found.lti, least=found.least), outcome, said


@method(FaultEstimation, "riccati", optimal=False, accuracy=LEVEL_ACCURACY)
def _riccati(program: FaultEstimation, context: Context) -> Claim:
    """Least stacked norm of the nominal plant, by two Riccati equations."""
    return nominal_filter(program, context, "riccati")


@conic_method(FaultEstimation, optimal=False, accuracy=LMI_ACCURACY)
def _conic(program: FaultEstimation, context: Context, solver: ConicSolver) -> Claim:
    """Least stacked norm of the nominal plant, by linear matrix inequalities."""
    return nominal_filter(program, context, solver.name)


def _certain(program: FaultEstimation) -> str | None:
    """The reason why mu synthesis cannot take a program without uncertainty; otherwise None."""
    return None if program.plant.structure else "its plant has no uncertainty; take riccati"


def _iteration(name: str) -> None:
    """Register the method of `MuSynthesis` with this name for fault estimation."""

    def iterate(program: FaultEstimation, context: Context) -> Claim:
        synthesis = MuSynthesis(program.plant, start=program.start)
        found, outcome, said = find_method(synthesis, name).answer(synthesis, context)
        if found is None:
            return None, outcome, said
        peaks = tuple(each.peak for each in found.history)
        return program.answer(found.K, history=peaks), outcome, said

    iterate.__doc__ = f"Least stacked mixed mu over the set of plants, by method {name!r}."
    method(FaultEstimation, name, optimal=False, unfit=_certain, accuracy=ANY_ACCURACY_ALIKE)(
        iterate
    )


for _name in MU_METHODS:
    _iteration(_name)


def _unfiltered(program: FaultEstimation) -> Any:
    """The nominal plant from (w_d, w_f) to z without a filter: u_f = 0."""
    nominal = program.nominal
    return nominal.close(_zero(nominal.controls, nominal.measurements))


def _zero(outputs: int, inputs: int) -> Any:
    import control
    import numpy as np

    return control.ss([], [], [], np.zeros((outputs, inputs)))
