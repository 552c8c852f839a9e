"""Mu synthesis of controllers with fixed structure by nonsmooth optimisation of the parameters.

The peak is a maximum over frequency of functions that are smooth almost everywhere, with known
gradients. A step minimises the largest of their linearisations at all frequencies near the peak,
plus half the quadratic form of a quasi-Newton Hessian, within a trust region; it is taken if the
loop is stable and the peak falls.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
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
from workbench.synthesis.mu.quasi_newton import updated_hessian
from workbench.synthesis.mu.rounds import Iterate, packed, unpacked
from workbench.synthesis.mu.shippable import Shippable
from workbench.synthesis.mu.structured.starts import found_starts
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
SMALLEST_SLOPE = 1e-12
"""Slope over the peak that counts as none: it tells no unit."""
SETTLED_FALL, PATIENCE = 1e-4, 12
"""The optimisation is settled if the peak falls by less than this share over this number of
rounds."""


@method(MuSynthesis, "fixed", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _fixed(program: MuSynthesis, context: Context) -> Claim:
    """Nonsmooth optimisation over the start's family, or over all controllers of its order."""
    starts, begun = _starts(program, context)
    problems = [_problem(program, start) for start in starts]
    target = (program.target or 0.0) / (1 + PEAK_TOLERANCE)
    (first, x), *others = problems
    others += [(first, member) for member in _members(first, x, program.random, context.rng)]
    minima = [_minimised(first, x, context, target)]
    limit = context.options.time_limit
    spent = time.perf_counter() - context.started
    until = None if limit is None else time.time() + limit - spent
    beside = partial(_minimised_until, until, target)
    where = context.executor or InProcess()
    minima += spread(beside, others, where, context.progress, "further starts")
    history, said = min(minima, key=lambda each: each[0][-1].peak)
    return program.answer(history[-1].K, tuple(history)), Outcome.SOLVED, begun + said


def _starts(program: MuSynthesis, context: Context) -> tuple[list[StateSpace], str]:
    """Controllers to start from: the one given, or those that are found; and how."""
    if program.start is not None:
        failed = [c.name for c in program.demands.checks(program.start) if not c.holds]
        if failed:
            raise InputError(
                f"the start does not meet what is asked of the controller: {'; '.join(failed)}"
            )
        return [program.start], ""
    if program.order is None or program.family is not None:
        raise InputError(
            "a controller to start from is needed: give start, or order for one that is found"
        )
    starts, said = found_starts(program, context)
    return starts, f"{said}; "


def _problem(program: MuSynthesis, start: StateSpace) -> tuple[_Problem, RealArray]:
    """Mu over the parameters of the family, or of all controllers of the start's order."""
    if program.family is not None:
        family, x = program.family, program.family.parameters(start)
        return _Problem(program.plant, program.closed, family, program.demands), x
    modal, x = Modal.of(start)
    return _Problem(program.plant, program.closed, modal, program.demands), _stirred(modal, x)


def _stirred(family: Modal, x: RealArray) -> RealArray:
    """The same controller, with inputs for modes that neither input nor output moves.

    Where B and C of a mode are zero no small step of either has an effect.
    """
    n, m, p = family.order, family.inputs, family.outputs
    _, B, C, _ = np.split(x, np.cumsum([n, n * m, p * n]))
    B, C = B.reshape(n, m).copy(), C.reshape(p, n)
    for i in range(0, n, 2):
        part = slice(i, min(i + 2, n))
        if not B[part].any() and not C[:, part].any():
            B[part] = 1.0
    return np.concatenate([x[:n], B.ravel(), x[n + n * m :]])


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
    demands: Shippable = field(default_factory=Shippable)

    @cached_property
    def opened(self) -> GeneralisedPlant:
        """The plant with the controls as exogenous inputs too, and the measurements as outputs."""
        import control

        system, m, p = self.plant.system, self.plant.controls, self.plant.measurements
        inputs = [*range(system.ninputs), *range(system.ninputs - m, system.ninputs)]
        outputs = [*range(system.noutputs), *range(system.noutputs - p, system.noutputs)]
        doubled = control.StateSpace(
            system.A,
            system.B[:, inputs],
            system.C[outputs],
            system.D[np.ix_(outputs, inputs)],
            0,
            remove_useless_states=False,
        )
        return GeneralisedPlant(doubled, None, m, p)

    def loop(self, x: RealArray) -> StateSpace | None:
        """The closed loop; None where it is not stable, or K not what is asked."""
        K = self.family.system(x)
        if self.demands.asked and not self.demands.admits(K):
            return None
        loop = self.plant.close(K)
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
        try:
            family, new = Modal.of(K)
        except (
            InputError
        ):  # poles that met have no common block: go on with the corners as they are
            return self, x
        return replace(self, family=family), new

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
        # The loop as it is closed: the open one may have poles on the imaginary axis.
        m, p = self.plant.controls, self.plant.measurements
        whole = response(self.opened.close(self.family.system(x)), omega)
        N, back, out = whole[:, :-p, :-m], whole[:, :-p, -m:], whole[:, -p:, :-m]
        _, slopes = self.family.response(x, omega)
        bound: UpperBound = upper_bound(N, self.structure)
        # dN = back dK out
        with_K = out @ gradient(N, self.structure, bound) @ back
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
        hessian = updated_hessian(hessian, found.x - x, found.turned)
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
    until: float | None, target: float, begun: tuple[_Problem, RealArray]
) -> tuple[list[Iterate], str]:
    """`_minimised`, stopped at a time [s since the epoch], wherever it runs."""
    left = None if until is None else max(until - time.time(), SHORTEST)
    return _minimised(*begun, Context(Options(time_limit=left)), target)


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
    units = _known_units(units, slope, peak)
    rows, sides = problem.family.halfspaces(problem.demands.stable, problem.demands.fastest)
    room = (rows * units, sides - rows @ x) if len(rows) else None
    while radius > SMALLEST_RADIUS:
        scaled = hessian * units[:, None] * units
        step, level, weights = _step(scaled, slope * units, value, radius, room)
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


def _known_units(units: RealArray, slope: RealArray, peak: float) -> RealArray:
    """Units of parameters, where they are zero the step that moves a bound by the peak."""
    steepest = np.abs(slope).max(axis=0)
    moved = steepest > SMALLEST_SLOPE * peak
    by_slope = np.where(moved, peak / np.where(moved, steepest, 1.0), 1.0)
    found: RealArray = np.where(units > 0, units, by_slope)
    return found


def _step(
    hessian: RealArray,
    slope: RealArray,
    value: RealArray,
    radius: float,
    room: tuple[RealArray, RealArray] | None = None,
) -> tuple[RealArray, float, RealArray]:
    """The step d that minimises max(value + slope d) + d H d / 2 in a box, with G d <= h in `room`.

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
    if room is not None:
        rows = np.vstack([rows, np.hstack([room[0], np.zeros((len(room[0]), 1))])])
        sides = np.concatenate([sides, room[1]])
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
