"""Mu synthesis of controllers with fixed structure by nonsmooth optimisation of the parameters.

The peak is a maximum over frequency of functions that are smooth almost everywhere, with known
gradients. A step minimises the largest of their linearisations at all frequencies near the peak,
plus half the quadratic form of a quasi-Newton Hessian, within a trust region; it is taken if the
loop is stable and the peak falls.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.arrays import RealArray
from workbench.certify.stability import stability_of
from workbench.errors import InputError, SolverError
from workbench.executor import Context, InProcess, spread
from workbench.heavy_types import StateSpace
from workbench.mu import UpperBound, gradient, upper_bound
from workbench.program import Claim, method
from workbench.solvers import Options, Outcome
from workbench.structure import Structure
from workbench.synthesis.mu.families import Family, Modal
from workbench.synthesis.mu.program import PEAK_TOLERANCE, MuSynthesis
from workbench.synthesis.mu.rounds import Iterate, packed, unpacked
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import GeneralisedPlant, response

MOST_STEPS = 300
"""Most steps of the optimisation."""
LOWERED_SHARE = 0.6
"""A step lowers the bounds at all frequencies where they are above this share of the peak."""
RESOLVED_SHARE, MAXIMUM_TOLERANCE, GRID_REFINEMENTS = 0.8, 5e-4, 5
"""Maxima above the first share of the peak are refined until neighbours differ by less than the
second share of the peak, at most as often as the third number says."""
FIRST_RADIUS, LARGEST_RADIUS, SMALLEST_RADIUS = 0.1, 2.0, 1e-8
"""First, largest and smallest trust radius, in units of the parameters."""
ACCEPTED_SHARE, SHRINKING_SHARE, GROWING_SHARE = 0.02, 0.25, 0.7
"""Shares of the promised fall above which a step is taken, below which the radius is halved, and
above which it may grow."""
START_SPREAD, DRAWS_PER_START = 0.5, 20
"""Standard deviation of random starts, in units of the parameters, and the most draws per start
that is wanted."""
SHORTEST = 1e-3
"""Time for a start that comes late: it is its own answer [s]."""
LEAST_PROMISE = 1e-6
"""Share of the peak that a step must promise."""
SETTLED_FALL, PATIENCE = 1e-4, 12
"""The optimisation is settled if the peak falls by less than this share over this number of
rounds."""


@method(MuSynthesis, "fixed", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _fixed(program: MuSynthesis, context: Context) -> Claim:
    """Nonsmooth optimisation over the start's family, or over all controllers of its order."""
    if program.start is None:
        raise InputError("a controller to start from is needed: give start, of the order wanted")
    family, x = program.family, None
    if family is None:
        family, x = Modal.of(program.start)
    else:
        x = family.parameters(program.start)
    problem = _Problem(program.plant, program.closed, family)
    target = (program.target or 0.0) / (1 + PEAK_TOLERANCE)
    members = list(_members(problem, x, program.random, context.rng))
    minima = [_minimised(problem, x, context, target)]
    limit = context.options.time_limit
    spent = time.perf_counter() - context.started
    until = None if limit is None else time.time() + limit - spent
    beside = partial(_minimised_until, until, problem, target)
    where = context.executor or InProcess()
    minima += spread(beside, members, where, context.progress, "random starts")
    history, said = min(minima, key=lambda each: each[0][-1].peak)
    return program.answer(history[-1].K, tuple(history)), Outcome.SOLVED, said


def _members(
    problem: _Problem, x: RealArray, count: int, rng: np.random.Generator
) -> Iterator[RealArray]:
    """Random parameters around x with stable loops; fewer than `count` where few are stable."""
    units = problem.family.units(x)
    found = 0
    for _ in range(DRAWS_PER_START * count):
        member = x + START_SPREAD * units * rng.normal(size=x.size)
        if found < count and problem.loop(member) is not None:
            found += 1
            yield member


@dataclass(frozen=True, eq=False)
class _Problem:
    """Mixed mu of the loop as a function of the parameters of a family."""

    plant: GeneralisedPlant
    structure: Structure
    family: Family

    def loop(self, x: RealArray) -> StateSpace | None:
        """The closed loop; None where it is not stable."""
        loop = self.plant.close(self.family.system(x))
        return loop if stability_of(loop).holds else None

    def stable_loop(self, x: RealArray) -> StateSpace:
        """The closed loop of parameters known to be stabilising."""
        loop = self.loop(x)
        if loop is None:
            raise SolverError(
                "rounding hides whether the loop of a stabilising controller is stable"
            )
        return loop

    def about(self, K: StateSpace, x: RealArray) -> tuple[_Problem, RealArray]:
        """The problem, and parameters x, with the family of all controllers made for K."""
        if not isinstance(self.family, Modal):
            return self, x
        family, x = Modal.of(K)
        return replace(self, family=family), x

    def curve(self, loop: StateSpace) -> tuple[RealArray, RealArray]:
        """Frequencies (F,) [rad/s] that resolve the maxima of the upper bound, and bounds (F,)."""
        omega = frequencies_of(loop)
        bound = self._bound(loop, omega)
        for _ in range(GRID_REFINEMENTS):
            new = _beside(omega, bound)
            if not new.size:
                break
            place = np.argsort(np.concatenate([omega, new]))
            bound = np.concatenate([bound, self._bound(loop, new)])[place]
            omega = np.concatenate([omega, new])[place]
        return omega, bound

    def linear(self, x: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
        """Bounds (F,) at frequencies [rad/s] and their gradients (F, k) by the parameters."""
        P = response(self.plant.system, omega)
        m, p = self.plant.controls, self.plant.measurements
        K, slopes = self.family.response(x, omega)
        into, out = P[:, :-p, -m:], P[:, -p:, :-m]
        through = np.linalg.inv(np.eye(p) - P[:, -p:, -m:] @ K)
        back = np.linalg.inv(np.eye(m) - K @ P[:, -p:, -m:])
        N = P[:, :-p, :-m] + into @ K @ through @ out
        bound: UpperBound = upper_bound(N, self.structure)
        # dN = into back dK through out
        with_K = through @ out @ gradient(N, self.structure, bound) @ into @ back
        return bound.value, np.einsum("fij,fkji->fk", with_K, slopes).real

    def iterate(self, x: RealArray, bound: RealArray) -> Iterate:
        """The round that ends at x with bounds (F,)."""
        return Iterate(float(bound.max()), np.nan, np.nan, self.family.system(x))

    def _bound(self, loop: StateSpace, omega: RealArray) -> RealArray:
        """Upper bounds of mixed mu (F,) at frequencies [rad/s]."""
        value: RealArray = upper_bound(response(loop, omega), self.structure).value
        return value


def _beside(omega: RealArray, bound: RealArray) -> RealArray:
    """Frequencies to add on either side of maxima that are not resolved."""
    top = bound.max()
    left = np.concatenate([[0.0], bound[:-1]])
    right = np.concatenate([bound[1:], [0.0]])
    peak = (bound >= left) & (bound >= right) & (bound > RESOLVED_SHARE * top)
    steep = np.abs(np.diff(bound)) > MAXIMUM_TOLERANCE * top
    wanted = steep & (peak[1:] | peak[:-1])
    middle: RealArray = np.sqrt(omega[1:] * omega[:-1])[wanted]
    return middle


def _minimised(
    problem: _Problem, x: RealArray, context: Context, target: float
) -> tuple[list[Iterate], str]:
    """Minimise the peak from parameters x.

    Returns the rounds, each better than the one before, and the reason why they ended.
    """
    radius, hessian, begun = FIRST_RADIUS, np.zeros((x.size, x.size)), 0
    kept = context.checkpoint.load()
    if kept is not None:
        radius, hessian, begun = float(kept["radius"]), kept["hessian"], int(kept["begun"])
        x = kept["x"]
        if begun:
            problem, _ = problem.about(unpacked(kept)[begun].K, x)
    omega, bound = problem.curve(problem.stable_loop(x))
    history = unpacked(kept) if kept is not None else [problem.iterate(x, bound)]
    for number, each in enumerate(history, start=1):
        context.record(each.row(number))
    for _ in context.rounds(MOST_STEPS, "fixed structure", len(history) - 1):
        peak = history[-1].peak
        if peak <= target:
            return history, "reached the target"
        found = _lower(problem, x, (omega, bound), hessian, radius)
        if isinstance(found, str):
            if begun == len(history) - 1:
                return history, found
            # Begin again: curvature seen far away, or poles in one block, may hide the way down.
            begun = len(history) - 1
            problem, x = problem.about(history[-1].K, x)
            omega, bound = problem.curve(problem.stable_loop(x))
            radius, hessian = FIRST_RADIUS, np.zeros_like(hessian)
            continue
        hessian = _updated(hessian, found.x - x, found.turned)
        radius = found.next_radius
        x, omega, bound = found.x, *found.curve
        history.append(problem.iterate(x, bound))
        context.record(history[-1].row(len(history)))
        earlier = history[:-PATIENCE]
        if earlier and history[-1].peak > (1 - SETTLED_FALL) * earlier[-1].peak:
            return history, "settled"
        state = {"x": x, "radius": np.array(radius), "hessian": hessian, "begun": np.array(begun)}
        context.checkpoint.save(state | packed(history))
    return history, f"stopped after {MOST_STEPS} rounds"


def _minimised_until(
    until: float | None, problem: _Problem, target: float, x: RealArray
) -> tuple[list[Iterate], str]:
    """`_minimised`, stopped at a time [s since the epoch], wherever it runs."""
    left = None if until is None else max(until - time.time(), SHORTEST)
    return _minimised(problem, x, Context(Options(time_limit=left)), target)


class _Lower(NamedTuple):
    """Parameters with a lower peak, their curve (omega, bound), and what the step to them taught.

    turned: change of the largest bound's gradient (k,).
    """

    x: RealArray
    curve: tuple[RealArray, RealArray]
    turned: RealArray
    next_radius: float


def _lower(
    problem: _Problem,
    x: RealArray,
    curve: tuple[RealArray, RealArray],
    hessian: RealArray,
    radius: float,
) -> _Lower | str:
    """The first step within the trust radius, or a smaller one, that is taken; else why none is."""
    (omega, bound), units = curve, problem.family.units(x)
    peak = float(bound.max())
    near = omega[bound > LOWERED_SHARE * peak]
    value, slope = problem.linear(x, near)
    while radius > SMALLEST_RADIUS:
        scaled = hessian * units[:, None] * units
        step, level, weights = _step(scaled, slope * units, value, radius)
        promised, length = peak - level, float(np.abs(step).max())
        if promised < LEAST_PROMISE * peak:
            return "no step promises less"
        trial = x + units * step
        loop = problem.loop(trial)
        if loop is not None:
            new = problem.curve(loop)
            share = (peak - float(new[1].max())) / promised
            if share > ACCEPTED_SHARE:
                turned = (problem.linear(trial, near)[1] - slope).T @ weights
                if share > GROWING_SHARE and length > 0.8 * radius:
                    radius = min(2.5 * radius, LARGEST_RADIUS)
                elif share < SHRINKING_SHARE:
                    radius *= 0.5
                return _Lower(trial, new, turned, radius)
        radius = 0.35 * min(radius, length)
    return "no step lowers the peak"


def _step(
    hessian: RealArray, slope: RealArray, value: RealArray, radius: float
) -> tuple[RealArray, float, RealArray]:
    """The step d that minimises max(value + slope d) + d H d / 2 in a box.

    Returns d, the level of the maximum, and the weights (multipliers) of the values in it.
    """
    import clarabel
    from scipy.sparse import block_diag, csc_matrix, triu

    n = len(hessian)
    values, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
    convex = (vectors * np.maximum(values, 1e-9)) @ vectors.T
    box = np.hstack([np.eye(n), np.zeros((n, 1))])
    rows = np.vstack([np.column_stack([slope, -np.ones(len(value))]), box, -box])
    sides = np.concatenate([-value, np.full(2 * n, radius)])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solution = clarabel.DefaultSolver(
        csc_matrix(triu(block_diag([convex, csc_matrix((1, 1))]))),
        np.append(np.zeros(n), 1.0),
        csc_matrix(rows),
        sides,
        [clarabel.NonnegativeConeT(len(sides))],
        settings,
    ).solve()
    found = np.array(solution.x)
    return found[:n], float(found[n]), np.maximum(np.array(solution.z)[: len(value)], 0.0)


def _updated(hessian: RealArray, step: RealArray, change: RealArray) -> RealArray:
    """Powell's damped BFGS update of a Hessian by a step and the change of the gradient."""
    along = hessian @ step
    curved, seen = float(step @ along), float(step @ change)
    if curved <= 0.0:
        return np.outer(change, change) / seen if seen > 0 else hessian
    share = 1.0 if seen >= 0.2 * curved else 0.8 * curved / (curved - seen)
    blend = share * change + (1 - share) * along
    update: RealArray = (
        np.outer(blend, blend) / float(step @ blend) - np.outer(along, along) / curved
    )
    return hessian + update
