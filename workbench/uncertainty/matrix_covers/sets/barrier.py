"""The smallest sets by Newton's method along geodesics, at all frequencies at once.

With P = W_1^-1, S = W_2^-1 and M_k = P (E_k - Z) S, the set {Z + W_1 Delta W_2} contains E_k if
|M_k| <= 1. A step changes P to exp(A) P, S to S exp(B) and Z to Z + P^-1 z S^-1, where A and B are
Hermitian. So M_k becomes exp(A) (M_k - z) exp(B). The barrier -sum log det(I - M_k M_k^*) is convex
along exp(t A), exp(t B): the norm of M_k and of each of its exterior powers is log-convex there, by
Hadamard's three lines theorem. The size of the set is convex too, so Newton's method with a fixed
centre finds the global optimum. With a free centre it finds a local optimum of the volume, and the
global optimum of the trace, which is convex in (W_1 W_1^*, W_2^* W_2, Z).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from workbench.executor import Context
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.uncertainty.matrix_covers.sets.loop import loop_in_unit
from workbench.uncertainty.matrix_covers.sets.multipliers import with_balanced_multipliers
from workbench.uncertainty.matrix_covers.sets.newton import BarrierSets
from workbench.uncertainty.matrix_covers.sets.program import MatrixSets

FALL = 0.05
"""Factor from one weight of the barrier to the next. Half or double: fewer but longer rounds of
Newton's method, or more and shorter ones, to the same last barrier.
"""
DECREMENT = 1e-6
"""Newton's method with the last barrier stops below this: half the squared Newton decrement,
relative to the barrier's weight. After one step more the error is about the square of it. Half or
double: the same number of steps or one more or less; the gap to the optimum is proven afterwards.
"""
NEAR_ENOUGH = 0.05
"""The same, for the barriers before the last one. A start for the next barrier needs no more. Half
takes a step more for each barrier; double starts farther away, and the next one takes longer.
"""
GAP_SHARE = 0.3
"""Error of the size that the last barrier leaves, as a share of the tolerance. The rest is for
`DECREMENT` and the proof. With half of it a barrier more is solved at times; with double of it the
proof may not reach the tolerance.
"""


@method(MatrixSets, "barrier", optimal=True)
def _barrier(program: MatrixSets, context: Context) -> Claim:
    """Interior-point method along geodesics, at all frequencies at once."""
    unit = 2.0 ** np.round(np.log2(np.abs(program.deviations).max(axis=(1, 2, 3), keepdims=True)))
    scaled = replace(program, deviations=program.deviations / unit)
    if program.loop is not None:  # X / unit closes the same loops as X
        rows = program.deviations.shape[2]
        scaled = replace(scaled, loop=loop_in_unit(program.loop, unit[:, 0], rows))
    state = BarrierSets(scaled)
    count = state.constraints
    goal = GAP_SHARE * context.options.accuracy * 2 * state.p * state.m / count
    for mu in context.track(list(_weights(goal)), "barriers"):
        state.minimise(mu, DECREMENT if mu == goal else NEAR_ENOUGH)
    found, unit = state.found(), unit[:, 0]
    found = replace(found, left=found.left * unit, centre=found.centre * unit)
    return with_balanced_multipliers(program, found), Outcome.SOLVED, ""


def _weights(goal: float) -> Iterator[float]:
    """Decreasing weights of the barrier; the last one is the goal."""
    mu = 1.0
    while mu > goal:
        yield mu
        mu *= FALL
    yield goal
