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

TRIAL_FREQUENCIES = 100
"""Largest number of frequencies at which starts are tried."""
FINAL_FREQUENCIES = 1000
"""Largest number of frequencies at which the best starts are finished."""
FINISHED_STARTS = 6
"""Number of starts that are finished; the one with the smallest fitted sets is the answer, judged
where known plants' resonances show too."""


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
    found, said = _tried(_trial(program), context)
    if not found:
        return None, Outcome.FAILED, said
    first = program.first_set(program.points)
    fine, answers = program.thinned(FINAL_FREQUENCIES).refined(), []
    for _, nominal, W_r in sorted(found, key=_size)[:FINISHED_STARTS]:
        _, nominal, W_r = smallest_sets(fine, nominal, W_r, context)
        nominal = program.realisable(nominal)
        third = program.third_set(program.away(nominal, program.points), W_r)
        answers.append(program.finished(first, nominal, third, W_r, context))
    return min(answers, key=program.refined().objective), Outcome.SOLVED, said


def _trial(program: UncertaintyCover) -> UncertaintyCover:
    """The program at few frequencies; where it has fewer, also at those of known resonances."""
    few = len(program.responses.omega) < TRIAL_FREQUENCIES
    return (program.refined() if few else program).thinned(TRIAL_FREQUENCIES)


def _tried(program: UncertaintyCover, context: Context) -> tuple[list[FoundModel], str]:
    """The smallest sets found from every start, and a message about them."""
    found: list[FoundModel] = []
    circles: list[FoundModel] = []
    said = []

    def stadiums(nominal: Rational) -> list[FoundModel]:
        assert isinstance(program, StadiumCover)
        weights = real_weights(program, nominal, context)
        return [smallest_sets(program, nominal, W_r, context) for W_r in weights]

    for name, (response, sizes) in nominals(program).items():
        try:
            nominal = through(response, sizes, program, context)
            program.away(nominal, program.points)  # raises where the nominal passes through zero
            circles.append(smallest_sets(program, nominal, None, context))
            own = stadiums(nominal) if isinstance(program, StadiumCover) else circles[-1:]
        except (InputError, SolverError) as error:
            said.append(f"none from {name} ({error})")
            continue
        found += own
        said.append(f"{_size(min(own, key=_size)):.4g} from {name}")
        if program.nominal is not None:
            return found, f"mean square size {said[0]}"  # there is one start only
    if circles and isinstance(program, StadiumCover):
        found += (own := stadiums(min(circles, key=_size)[1]))
        said.append(f"{_size(min(own, key=_size)):.4g} from the smallest circles")
    return found, f"mean square size {', '.join(said)}"


def _size(found: FoundModel) -> float:
    """Mean square size, by which sets are compared."""
    return found[0]
