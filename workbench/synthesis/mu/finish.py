"""The end of an iteration: reduce the best controller and certify it within the time limit."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.stability import stability_check
from workbench.errors import InputError, TimeLimitError
from workbench.executor import Context
from workbench.executor.clock import proving, tick
from workbench.mu import upper_bound
from workbench.program import Claim
from workbench.solvers import Outcome
from workbench.synthesis.mu.mu_controller import MuController
from workbench.synthesis.mu.program import PEAK_TOLERANCE, MuSynthesis
from workbench.synthesis.mu.rounds import Iterate
from workbench.synthesis.reduction.kept_part import kept_and_stable
from workbench.synthesis.reduction.truncation import (
    Reducer,
    balanced_truncation,
    loop_weighted_truncation,
)
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import GeneralisedPlant, response
from workbench.systems.realisation import Matrices, matrices_of, realisation

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
    then on there is a ``sure`` answer, and the time for another certificate is reserved. The order
    is reduced with the plant that ``scaled`` gives for the parameters of scalings; None for
    controllers of a demanded structure, which are not reduced.
    """

    program: MuSynthesis
    context: Context
    scaled: Callable[[Mapping[str, RealArray]], GeneralisedPlant] | None = None
    sure: MuController | None = None

    def resume(self, history: Sequence[Iterate]) -> None:
        """Record the rounds before an interruption, and offer their best controller."""
        for number, each in enumerate(history, start=1):
            self.context.record(each.row(number))
        if history:
            self.offer(min(history, key=lambda each: each.peak))

    def offer(self, here: Iterate) -> None:
        """Certify a controller at once if time is limited and it is the first or much better.

        The scalings of the round may be those of the controller's design.
        """
        if self.context.options.time_limit is None:
            return
        if self.sure is not None and here.peak > (1 - MUCH_BETTER) * self.sure.upper:
            return
        started = time.perf_counter()
        found = self._certified_answer(here, ())
        self.sure = found or self.sure
        self.context.reserved = KEPT_SHARE * (time.perf_counter() - started)

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
            return self._certified_answer(best, history), Outcome.SOLVED, said
        # checking an answer takes as long as certifying it
        self.context.reserved = 0.0
        seconds = max(self.context.remaining / 2, LEAST_SECONDS)
        self.context.reserved = self.context.remaining - seconds
        found = None
        try:
            if best.peak < self.sure.upper:
                with proving(seconds):
                    found = self._certified_answer(best, history)
        except TimeLimitError as error:
            said = self.late(error)
        return found or replace(self.sure, history=tuple(history)), Outcome.SOLVED, said

    def _certified_answer(self, here: Iterate, history: Sequence[Iterate]) -> MuController | None:
        """The certified answer for a controller, reduced as far as its peak allows."""
        K = here.K
        if self.scaled is not None:
            most = (1 + PEAK_TOLERANCE) * here.peak
            K = with_few_states(self.program, K, most, self.scaled(here.scalings))
        return self.program.answer(K, history=tuple(history))


def with_few_states(
    program: MuSynthesis, K: StateSpace, most: float, scaled: GeneralisedPlant | None = None
) -> StateSpace:
    """K with the fewest states found whose loop has mu of at most `most`.

    Doubling and bisection find the order; mu is evaluated at frequencies of the loop. Each order is
    tried with two truncations. The first is weighted by the loop with the plant ``scaled`` (that of
    the program if not given): the change of this loop is what raises the bound that its scalings
    prove. The second weighs all frequencies alike and keeps poles on the axis. Demands that K meets
    are also met by the result.
    """
    ways = _truncations(matrices_of(K), matrices_of((scaled or program.plant).close(K)))
    demands = program.demands
    needed = demands if demands.admits(K) else None

    def suits(trial: StateSpace) -> bool:
        tick("order of the controller")
        loop = program.plant.close(trial)
        if not stability_check(loop).holds or not (needed is None or needed.admits(trial)):
            return False
        M = response(loop, frequencies_of(loop))
        return float(upper_bound(M, program.closed_structure).value.max()) <= most

    def suitable(order: int) -> StateSpace | None:
        trials = (realisation(way(order), 0.0) for least, way in ways if least <= order)
        return next(filter(suits, trials), None)

    # With all states K has better coordinates at least, in which its certificate needs less time.
    fewest, low, high = K, 0, int(K.nstates) + 1
    order = max(1, program.plant.system.nstates)  # small loops cost little
    while low < high:
        order = min(order, high - 1)
        trial = suitable(order)
        if trial is None:
            low = order + 1
        else:
            fewest, high = trial, order
        order = 2 * order if fewest is K else (low + high) // 2
    return fewest


def _truncations(K: Matrices, loop: Matrices) -> list[tuple[int, Reducer]]:
    """Truncations of K and the least order of each, weighted by a loop and without a weight.

    One whose Gramians do not exist in doubles is left out.
    """
    ways: list[Callable[[], tuple[int, Reducer]]] = [
        lambda: (0, loop_weighted_truncation(K, loop)),
        lambda: balanced_truncation(kept_and_stable(K)),
    ]
    found = []
    for way in ways:
        with suppress(InputError):
            found.append(way())
    return found
