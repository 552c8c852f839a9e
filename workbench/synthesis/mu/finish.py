"""The end of an iteration: reduce the best controller and certify it within the time limit."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from workbench._core.heavy_types import StateSpace
from workbench.certify.stability import stability_check
from workbench.errors import TimeLimitError
from workbench.executor import Context
from workbench.executor.clock import proving, tick
from workbench.mu import upper_bound
from workbench.program import Claim
from workbench.solvers import Outcome
from workbench.synthesis.mu.mu_controller import MuController
from workbench.synthesis.mu.program import PEAK_TOLERANCE, MuSynthesis
from workbench.synthesis.mu.rounds import Iterate
from workbench.synthesis.reduction.kept_part import kept_and_stable
from workbench.synthesis.reduction.truncation import balanced_truncation
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import matrices_of, realisation

KEPT_SHARE = 3.0
"""Reserved time, as a multiple of the time that the last certificate took. One more controller must
be certified, and its certificate is checked.
"""
LEAST_SECONDS = 0.5
"""Time [s] in which the last certificate may be made, even after the limit."""
MUCH_BETTER = 0.005
"""A controller is certified at once if its peak is lower by this share than the certified one."""


@dataclass(eq=False)
class Finish:
    """Certifies the best controller of an iteration, with few states.

    If time is limited, the first controller, and every much better one, is certified at once. From
    then on there is a ``sure`` answer, and the time for another certificate is reserved. With
    ``reduces`` the order is reduced; controllers of a demanded structure are not reduced.
    """

    program: MuSynthesis
    context: Context
    sure: MuController | None = None
    reduces: bool = True

    def resume(self, history: Sequence[Iterate]) -> None:
        """Record the rounds before an interruption, and offer their best controller."""
        for number, each in enumerate(history, start=1):
            self.context.record(each.row(number))
        if history:
            best = min(history, key=lambda each: each.peak)
            self.offer(best.K, best.peak)

    def offer(self, K: StateSpace, peak: float) -> None:
        """Certify a controller at once if time is limited and it is the first or much better.

        `peak` is the controller's largest bound over the frequencies.
        """
        if self.context.options.time_limit is None:
            return
        if self.sure is not None and peak > (1 - MUCH_BETTER) * self.sure.upper:
            return
        started = time.perf_counter()
        found = self._certified_answer(K, peak, ())
        self.sure = found or self.sure
        self.context.kept_back = KEPT_SHARE * (time.perf_counter() - started)

    def late(self, error: TimeLimitError) -> str:
        """The message if the time limit stopped the rounds; raises the error if there is no answer
        yet.
        """
        if self.sure is None:
            raise error
        self.context.stop(str(error).partition(":")[0])
        return self.context.stopped

    def claim(self, history: Sequence[Iterate], said: str) -> Claim:
        """The best controller of the rounds, certified; the sure one if time ends before."""
        best = min(history, key=lambda each: each.peak, default=None)
        if best is None:
            return self.sure, Outcome.FAILED if self.sure is None else Outcome.SOLVED, said
        if self.sure is None:
            return self._certified_answer(best.K, best.peak, history), Outcome.SOLVED, said
        # checking an answer takes as long as certifying it
        self.context.kept_back = 0.0
        seconds = max(self.context.left / 2, LEAST_SECONDS)
        self.context.kept_back = self.context.left - seconds
        found = None
        try:
            if best.peak < self.sure.upper:
                with proving(seconds):
                    found = self._certified_answer(best.K, best.peak, history)
        except TimeLimitError as error:
            said = self.late(error)
        return found or replace(self.sure, history=tuple(history)), Outcome.SOLVED, said

    def _certified_answer(
        self, K: StateSpace, peak: float, history: Sequence[Iterate]
    ) -> MuController | None:
        """The certified answer for a controller, reduced as far as its peak allows."""
        if self.reduces:
            K = with_few_states(self.program, K, (1 + PEAK_TOLERANCE) * peak)
        return self.program.answer(K, history=tuple(history))


def with_few_states(program: MuSynthesis, K: StateSpace, most: float) -> StateSpace:
    """K after balanced truncation to the least order whose loop has mu of at most `most`.

    Doubling and bisection find the order; mu is evaluated at frequencies of the loop. Demands that
    K meets are also met by the result.
    """
    least, of = balanced_truncation(kept_and_stable(matrices_of(K)))
    demands = program.demands
    needed = demands if demands.admits(K) else None

    def suits(trial: StateSpace) -> bool:
        tick("order of the controller")
        loop = program.plant.close(trial)
        if not stability_check(loop).holds or not (needed is None or needed.admits(trial)):
            return False
        M = response(loop, frequencies_of(loop))
        return float(upper_bound(M, program.closed).value.max()) <= most

    fewest, low, high = K, least, int(K.nstates)
    order = max(least, program.plant.system.nstates)  # small loops cost little
    while low < high:
        trial = realisation(of(min(order, high - 1)), 0.0)
        if suits(trial):
            fewest, high = trial, int(trial.nstates)
        else:
            low = order + 1
        order = 2 * order if fewest is K else (low + high) // 2
    return fewest
