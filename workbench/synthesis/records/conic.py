"""Feedback from records by linear matrix inequalities, with any conic solver."""

from __future__ import annotations

from workbench._core.arrays import RealArray
from workbench.accuracy import AccuracyRange
from workbench.conic import ConicForm, ConicProgram
from workbench.executor import Context
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Outcome
from workbench.synthesis.records.inequalities import ProvenFeedback
from workbench.synthesis.records.program import FeedbackFromRecords
from workbench.synthesis.records.search import least_rate

FINEST_ACCURACY = 1e-5
"""Finest accuracy asked of solvers. It is much finer than the least rise of the level above its
minimum.
"""
LEVEL_RISES = (1e-3, 5e-3, 2e-2, 1e-1)
"""Relative distances above the least level, tried until the checks of an answer hold."""


@conic_method(FeedbackFromRecords, optimal=False, accuracy=AccuracyRange(finest=FINEST_ACCURACY))
def _conic(program: FeedbackFromRecords, context: Context, solver: ConicSolver) -> Claim:
    """The least level of the LMI, then its centre at a level 1e-3 higher (up to 1e-1 if needed)."""
    said = ""

    def centred(level: float) -> ProvenFeedback | None:
        nonlocal said
        x, _, said = _solve_form(program.scaled.form(level, centred=True), context, solver)
        if x is None or x[-1] <= 0.0:
            return None
        answer = program.scaled.taken(x, level)
        return answer if program.proven(answer) else None

    if program.criterion == "decay":
        answer = least_rate(centred, context)
        return (
            (answer, Outcome.SOLVED, said)
            if answer
            else _claim_without_answer(program, context, solver)
        )
    x, outcome, said = _solve_form(program.conic_form(), context, solver)
    if x is None or outcome.without_answer:
        return _claim_without_answer(program, context, solver)
    least = program.scaled.level_of(x)
    for rise in LEVEL_RISES:
        answer = centred(least * (1.0 + rise))
        if answer is not None:
            return answer, Outcome.SOLVED, said
    return _claim_without_answer(program, context, solver)


def _claim_without_answer(
    program: FeedbackFromRecords, context: Context, solver: ConicSolver
) -> Claim:
    """The claim where no answer was found: what the solver says for the rate 1."""
    _, outcome, said = _solve_form(program.stabilising.conic_form(), context, solver)
    if outcome is Outcome.INFEASIBLE:
        return None, outcome, f"{said}: no Lyapunov matrix proves a gain for every plant"
    return None, Outcome.FAILED, f"{said}; no level that it found can be proven"


def _solve_form(
    form: ConicForm, context: Context, solver: ConicSolver
) -> tuple[RealArray | None, Outcome, str]:
    """The variables of a form (None without a solution), the solver's outcome and its message."""
    answer, outcome, said = ConicProgram(form).respond(solver.name, context)
    return None if answer is None else answer["x"].values, outcome, said
