"""The default method of the magnitude fit."""

from __future__ import annotations

from workbench.errors import TimeLimitError, WorkbenchError
from workbench.executor import Context
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.program import Claim, method, methods
from workbench.solvers import Outcome

CANDIDATES = ("minimax", "sb10yd", "sk")
"""Methods that are tried in turn, until one is proven optimal."""


@method(MagnitudeFit, "best", optimal=True)
def _best(program: MagnitudeFit, context: Context) -> Claim:
    """Minimax if it is proven optimal; else the best valid answer of minimax, SB10YD and SK."""
    tolerance, found, failed = context.options.accuracy, [], []
    for name in CANDIDATES:
        try:
            answer, _, _ = methods(program)[name].answer(program, context)
        except TimeLimitError:
            raise
        except (ArithmeticError, ValueError, WorkbenchError) as error:
            failed.append(f"{name}: {error}")
            continue
        certificate = program.certify(answer, tolerance, optimal=True)
        if certificate.holds:
            return answer, Outcome.SOLVED, f"{name}, proven optimal"
        if certificate.valid:
            found.append((program.error(answer), name, answer))
        else:
            failed.append(f"{name}: {'; '.join(certificate.failures)}")
    if not found:
        return None, Outcome.FAILED, "; ".join(failed)
    _, name, answer = min(found, key=lambda candidate: candidate[0])
    message = "; ".join(
        [f"{name}, the best of {', '.join(CANDIDATES)}, not proven optimal", *failed]
    )
    return answer, Outcome.INACCURATE, message
