"""The end of an iteration: its best controller with few states, certified within the time limit."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

from workbench.certify.stability import stability_of
from workbench.errors import TimeLimitError
from workbench.executor import Context
from workbench.executor.clock import tick
from workbench.heavy_types import StateSpace
from workbench.mu import upper_bound
from workbench.program import Claim
from workbench.solvers import Outcome
from workbench.synthesis.mu.program import PEAK_TOLERANCE, MuController, MuSynthesis
from workbench.synthesis.mu.rounds import Iterate
from workbench.synthesis.reduction.kept_part import kept_and_stable
from workbench.synthesis.reduction.truncation import balanced_truncation
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import matrices_of, realisation

SMALL_LOOP = 60
"""States up to which a certificate takes about the same time; it grows with the cube of more."""
USUAL_ORDER = 2
"""Order of a controller with few states over that of its plant, for which time is kept back."""
KEPT_SHARE = 3.0
"""Time kept back over that of a certificate: it is made, then checked, and may take longer."""


@dataclass(eq=False)
class Finish:
    """The end of an iteration that may have a time limit.

    Where it has one, the ``first`` controller is certified at once, in some ``seconds``. From then
    on there is an answer, and the time that another certificate needs is kept back.
    """

    program: MuSynthesis
    context: Context
    first: MuController | None = None

    def begin(self, K: StateSpace) -> None:
        """Certify the first controller if time is limited; later ones are none of it."""
        if self.context.options.time_limit is None or self.first is not None:
            return
        started = time.perf_counter()
        self.first = self.program.answer(K)
        seconds = time.perf_counter() - started
        n = self.program.plant.system.nstates
        larger = _effort((1 + USUAL_ORDER) * n) / _effort(n + K.nstates)
        self.context.kept_back = KEPT_SHARE * larger * seconds

    def late(self, error: TimeLimitError) -> str:
        """What is said where the clock stopped the rounds; without an answer so far, the error."""
        if self.first is None:
            raise error
        self.context.stop(str(error).partition(":")[0])
        return self.context.stopped

    def claim(self, history: Sequence[Iterate], said: str) -> Claim:
        """The best controller of the rounds with as few states as its peak allows, certified.

        Where time ends before that, the first one.
        """
        if not history:
            outcome = Outcome.FAILED if self.first is None else Outcome.SOLVED
            return self.first, outcome, said
        best = min(history, key=lambda each: each.peak)
        if self.first is not None:
            # a certificate is checked for as long as it takes to make it
            self.context.kept_back = 0.0
            self.context.kept_back = max(0.0, self.context.left / 2)
        try:
            K = with_few_states(self.program, best.K, (1 + PEAK_TOLERANCE) * best.peak)
            found = self.program.answer(K, tuple(history))
        except TimeLimitError as error:
            said, found = self.late(error), self.first
        return found, Outcome.SOLVED, said


def _effort(states: int) -> float:
    """Relative time of a certificate of a loop."""
    return float(states**3 + SMALL_LOOP**3)


def with_few_states(program: MuSynthesis, K: StateSpace, most: float) -> StateSpace:
    """K after balanced truncation to the least order whose loop has mu of at most `most`.

    The order is found by doubling and bisection, and mu judged at frequencies of the loop. Demands
    on the controller that K meets stay met.
    """
    least, of = balanced_truncation(kept_and_stable(matrices_of(K)))
    demands = program.demands
    needed = demands if demands.admits(K) else None

    def suits(trial: StateSpace) -> bool:
        tick("order of the controller")
        loop = program.plant.close(trial)
        if not stability_of(loop).holds or not (needed is None or needed.admits(trial)):
            return False
        M = response(loop, frequencies_of(loop))
        return float(upper_bound(M, program.closed).value.max()) <= most

    fewest, low, high = K, least, int(K.nstates)
    order = max(least, program.plant.system.nstates)  # small loops first: they cost little
    while low < high:
        trial = realisation(of(min(order, high - 1)), 0.0)
        if suits(trial):
            fewest, high = trial, int(trial.nstates)
        else:
            low = order + 1
        order = 2 * order if fewest is K else (low + high) // 2
    return fewest
