"""Two methods of the response fit: SLICOT's SB10YD, and the best of all other methods."""

from __future__ import annotations

from workbench.accuracy import ANY_ACCURACY_ALIKE, AccuracyRange
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.response.least_peak import polished
from workbench.fitting.response.nonlinear import IPOPT_ACCURACY, refined_from, worst_error
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


@method(ResponseFit, "best", optimal=False, accuracy=AccuracyRange(finest=IPOPT_ACCURACY))
def _best(program: ResponseFit, context: Context) -> Claim:
    """The fit of least error among vector-fitting, sb10yd, and IPOPT from the better of the two."""
    fits = vector_fits(program, context)
    found = {"vector-fitting": fits[0]}
    said: list[str] = []
    if reason := _unfit_for_sb10yd(program):
        said.append(f"sb10yd: {reason}")
    else:
        try:
            found["sb10yd"] = _sb10yd(program, context)[0]
            if worst_error(program, found["sb10yd"]) < worst_error(program, fits[0]):
                fits.append(polished(program, found["sb10yd"])[1])
        except SolverError as error:
            said.append(f"sb10yd: {error}")
    found["ipopt"], _, message = refined_from(program, fits, context)
    said.append(message)

    def rank(name: str) -> tuple[bool, float]:
        valid = program.certify(found[name], context.options.accuracy).valid
        return not valid, worst_error(program, found[name])

    ranks = {name: rank(name) for name in found}
    errors = [
        f"{name} {error:.4g}{' (invalid)' if invalid else ''}"
        for name, (invalid, error) in ranks.items()
    ]
    chosen = min(ranks, key=lambda name: ranks[name])
    return found[chosen], Outcome.SOLVED, "; ".join([f"{chosen} chosen", *errors, *said])
