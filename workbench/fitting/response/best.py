"""Two methods of the response fit: SLICOT's SB10YD, and the best of all other methods."""

from __future__ import annotations

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE, DEFAULT_TOLERANCE
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.response.least_peak import polished, worst_error
from workbench.fitting.response.program import ResponseFit
from workbench.fitting.response.vector_fitting import vector_fits
from workbench.fitting.slicot import sb10yd
from workbench.program import Claim, method
from workbench.solvers import Outcome, slycot_missing


def _unfit_for_sb10yd(program: ResponseFit) -> str | None:
    """Reason why SB10YD cannot answer a program; None if it can."""
    data = program.active
    if program.unstable_poles:
        return f"SB10YD holds no poles right of the axis; {program.unstable_poles} are asked for"
    if program.zeros < program.order:
        return f"SB10YD gives as many zeros as poles; {program.zeros} at most are asked for"
    zero = data.omega[data.response == 0]
    if zero.size:
        return f"the response is zero at {zero[0]:.6g} rad/s"
    return slycot_missing()


@method(ResponseFit, "sb10yd", optimal=False, unfit=_unfit_for_sb10yd, accuracy=ANY_ACCURACY_ALIKE)
def _sb10yd(program: ResponseFit, context: Context) -> Claim:
    """SLICOT's SB10YD, which has no weights and gives stability only with minimum phase."""
    data = program.active
    fit = sb10yd(data.omega, data.response, program.order, program.minimum_phase)
    return fit, Outcome.SOLVED, ""


@method(ResponseFit, "best", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _best(program: ResponseFit, context: Context) -> Claim:
    """The fit of least error of vector-fitting and sb10yd, which is refined if it is the better."""
    found = {"vector-fitting": vector_fits(program, context)[0]}
    said: list[str] = []
    if reason := _unfit_for_sb10yd(program):
        said.append(f"sb10yd: {reason}")
    else:
        try:
            found["sb10yd"] = _sb10yd(program, context)[0]
        except SolverError as error:
            said.append(f"sb10yd: {error}")
    errors = {name: worst_error(program, fit) for name, fit in found.items()}
    if errors.get("sb10yd", np.inf) < errors["vector-fitting"]:
        errors["refined"], found["refined"] = polished(program, found["sb10yd"])
    ranked = sorted(found, key=lambda name: errors[name])
    valid = (n for n in ranked if program.certify(found[n], DEFAULT_TOLERANCE).valid)
    chosen = next(valid, ranked[0])
    words = [f"{name} {errors[name]:.4g}" for name in found]
    return found[chosen], Outcome.SOLVED, "; ".join([f"{chosen} chosen", *words, *said])
