"""Methods of `Implementation`: ways of discretisation, and the best of them."""

from __future__ import annotations

from typing import get_args

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.errors import WorkbenchError
from workbench.executor import Context
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.synthesis.implementation.discretise import ImplementationMethod
from workbench.synthesis.implementation.program import Implementation


def _claim(program: Implementation, way: ImplementationMethod) -> Claim:
    return program.implemented(way), Outcome.SOLVED, f"discretised by {way}"


@method(Implementation, "tustin", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _tustin(program: Implementation, context: Context) -> Claim:
    """The bilinear transform."""
    return _claim(program, "tustin")


@method(Implementation, "zoh", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _zoh(program: Implementation, context: Context) -> Claim:
    """Zero-order hold: exact for a held measurement."""
    return _claim(program, "zoh")


@method(Implementation, "foh", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _foh(program: Implementation, context: Context) -> Claim:
    """First-order hold: exact for a measurement that is linear between samples."""
    return _claim(program, "foh")


@method(Implementation, "best", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _best(program: Implementation, context: Context) -> Claim:
    """The method of discretisation with the least certified peak."""
    found, said = [], []
    for way in get_args(ImplementationMethod):
        try:
            made = program.implemented(way)
        except WorkbenchError as error:
            said.append(f"{way}: {error}")
            continue
        found.append(made)
        said.append(f"{way}: peak {program.objective(made):.6g}")
    if not found:
        return None, Outcome.FAILED, "; ".join(said)
    return min(found, key=program.objective), Outcome.SOLVED, "; ".join(said)
