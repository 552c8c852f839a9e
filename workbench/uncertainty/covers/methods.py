"""Methods of covers: the nominal fitted to centres, or chosen for small sets."""

from __future__ import annotations

from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.uncertainty.covers.circle_cover import CircleCover
from workbench.uncertainty.covers.cover import UncertaintyCover
from workbench.uncertainty.covers.joint import FoundModel, smallest_sets
from workbench.uncertainty.covers.sides import warn_of_unstable
from workbench.uncertainty.covers.stadium_cover import StadiumCover
from workbench.uncertainty.covers.starts import nominals, real_weights, through
from workbench.uncertainty.covers.steps import CoverSteps

TRIAL_FREQUENCIES = 100
"""Largest number of frequencies at which starts are tried."""
FINAL_FREQUENCIES = 1000
"""Largest number of frequencies at which what the starts lead to is finished."""
MOST_RENEWALS = 3
"""Most searches that start from the nominal of the best cover and new real weights."""


@method(CircleCover, "steps", optimal=False)
@method(StadiumCover, "steps", optimal=False)
def _steps(program: UncertaintyCover, context: Context) -> Claim:
    """The steps of the thesis: the nominal is fitted to the centres of the first set."""
    warn_of_unstable(program.thinned(TRIAL_FREQUENCIES), context)
    first = program.first_set(program.points)
    nominal = program.realisable(through(first.center, first, program, context))
    third = program.third_set(program.away(nominal, program.points))
    W_r = program.real_weight(third, context)
    return program.finished(first, nominal, third, W_r, context), Outcome.SOLVED, ""


@method(CircleCover, "joint", optimal=False)
@method(StadiumCover, "joint", optimal=False)
def _joint(program: UncertaintyCover, context: Context) -> Claim:
    """Nominal and real weight are chosen together for the least mean square size of the sets."""
    warn_of_unstable(program.thinned(TRIAL_FREQUENCIES), context)
    trial = _trial(program)
    found, said = _tried(trial, context)
    if not found:
        return None, Outcome.FAILED, said
    objective = program.refined().objective
    best = min(_finished(program, found, context), key=objective)
    for _ in range(MOST_RENEWALS if isinstance(program, StadiumCover) else 0):
        try:
            again = _renewed(trial, best.model.nominal, context)
            better = min(_finished(program, again, context), key=objective)
        except (InputError, SolverError) as error:
            return best, Outcome.SOLVED, f"{said}, none renewed ({error})"
        if objective(better) >= objective(best):
            break
        best = better
    return best, Outcome.SOLVED, said


def _finished(
    program: UncertaintyCover, found: list[FoundModel], context: Context
) -> list[CoverSteps]:
    """The covers by models found at few frequencies, which are searched again at many.

    Their fitted sets are compared, where known plants' resonances show too: what is small at few
    frequencies need not be.
    """
    first = program.first_set(program.points)
    fine, answers = program.thinned(FINAL_FREQUENCIES).refined(), []
    for _, nominal, W_r in found:
        _, nominal, W_r = smallest_sets(fine, nominal, W_r, context)
        nominal = program.realisable(nominal)
        third = program.third_set(program.away(nominal, program.points), W_r)
        answers.append(program.finished(first, nominal, third, W_r, context))
    return answers


def _renewed(program: UncertaintyCover, nominal: Rational, context: Context) -> list[FoundModel]:
    """The smallest sets found from a nominal and each real weight fitted to its third set."""
    assert isinstance(program, StadiumCover)
    weights = real_weights(program, nominal, context)
    return [smallest_sets(program, nominal, W_r, context) for W_r in weights]


def _trial(program: UncertaintyCover) -> UncertaintyCover:
    """The program at few frequencies; where it has fewer, also at those of known resonances."""
    few = len(program.responses.omega) < TRIAL_FREQUENCIES
    return (program.refined() if few else program).thinned(TRIAL_FREQUENCIES)


def _tried(program: UncertaintyCover, context: Context) -> tuple[list[FoundModel], str]:
    """The smallest sets found from every start, and a message about them."""
    found: list[FoundModel] = []
    circles: list[FoundModel] = []
    said = []

    for name, (response, sizes) in nominals(program).items():
        try:
            nominal = through(response, sizes, program, context)
            program.away(nominal, program.points)  # raises where the nominal passes through zero
            circles.append(smallest_sets(program, nominal, None, context))
            own = circles[-1:]
            if isinstance(program, StadiumCover):
                own = _renewed(program, nominal, context)
        except (InputError, SolverError) as error:
            said.append(f"none from {name} ({error})")
            continue
        found += own
        said.append(f"{_size(min(own, key=_size)):.4g} from {name}")
        if program.nominal is not None:
            return found, f"mean square size {said[0]}"  # there is one start only
    if circles and isinstance(program, StadiumCover):
        found += (own := _renewed(program, min(circles, key=_size)[1], context))
        said.append(f"{_size(min(own, key=_size)):.4g} from the smallest circles")
    return found, f"mean square size {', '.join(said)}"


def _size(found: FoundModel) -> float:
    """Mean square size, by which sets are compared."""
    return found[0]
