"""Controllers of fixed structure: mixed mu's peak minimised over their parameters.

The peak is a maximum over frequency of functions that are smooth almost everywhere, with known
gradients. A step minimises the largest of their linearisations at all frequencies near the peak,
plus half the quadratic form of a quasi-Newton Hessian, within a trust region; it is taken if the
loop is stable and the peak falls.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workbench.arrays import RealArray
from workbench.certify.stability import stability_of
from workbench.errors import InputError
from workbench.executor import Context
from workbench.heavy_types import StateSpace
from workbench.mu import UpperBound, gradient, upper_bound
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.structure import Structure
from workbench.synthesis.mu.families import Family, Modal
from workbench.synthesis.mu.program import TOLERANCE, MuSynthesis
from workbench.synthesis.mu.rounds import Iterate, packed, unpacked
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import GeneralisedPlant, response

ROUNDS = 300
NEAR = 0.6
"""Share of the peak from which a frequency's bound is among those that a step lowers."""
TOP, FLAT, HALVINGS = 0.8, 5e-4, 5
"""Maxima above that share of the peak are resolved to where neighbours are as near, relative."""
FIRST, LARGEST, SMALLEST = 0.1, 2.0, 1e-8
"""Trust radius, in units of the parameters."""
TAKEN, SHRUNK, GROWN = 0.02, 0.25, 0.7
"""Shares of the promised fall at which a step is taken, and its radius halved or enlarged."""
SPREAD, DRAWS = 0.5, 20
"""Of random starts, in units of the parameters, and how many are drawn for each that is wanted."""
SETTLED, PATIENCE = 1e-4, 12
"""Relative fall of the peak over so many rounds at which it counts as settled."""


@method(MuSynthesis, "fixed", optimal=False)
def _fixed(program: MuSynthesis, context: Context) -> Claim:
    """Parameters of the start's structure, or of its order, by nonsmooth optimisation."""
    if program.start is None:
        raise InputError("a controller to start from is needed: give start, of the order wanted")
    family, x = program.family, None
    if family is None:
        family, x = Modal.of(program.start)
    else:
        x = family.parameters(program.start)
    problem = _Problem(program.plant, program.closed, family)
    target = (program.target or 0.0) / (1 + TOLERANCE)
    beside = Context(context.options, context.progress, started=context.started)
    minima = [
        _minimised(problem, x, context, target),
        *(
            _minimised(problem, member, beside, target)
            for member in _members(problem, x, program.random, context.rng)
        ),
    ]
    history, said = min(minima, key=lambda each: each[0][-1].peak)
    return program.answer(history[-1].K, tuple(history)), Outcome.SOLVED, said


def _members(
    problem: _Problem, x: RealArray, count: int, rng: np.random.Generator
) -> Iterator[RealArray]:
    """Random parameters about x whose loops are stable; fewer than asked for where few are."""
    units = problem.family.units(x)
    found = 0
    for _ in range(DRAWS * count):
        member = x + SPREAD * units * rng.normal(size=x.size)
        if found < count and problem.loop(member) is not None:
            found += 1
            yield member


@dataclass(frozen=True, eq=False)
class _Problem:
    """Mixed mu of the loop with a member of a family."""

    plant: GeneralisedPlant
    structure: Structure
    family: Family

    def loop(self, x: RealArray) -> StateSpace | None:
        """The closed loop; None where it is not stable."""
        loop = self.plant.close(self.family.system(x))
        return loop if stability_of(loop).holds else None

    def curve(self, loop: StateSpace) -> tuple[RealArray, RealArray]:
        """Frequencies [rad/s], its maxima resolved, and bounds (F,)."""
        omega = frequencies_of(loop)
        bound = self._bound(loop, omega)
        for _ in range(HALVINGS):
            new = _beside(omega, bound)
            if not new.size:
                break
            place = np.argsort(np.concatenate([omega, new]))
            bound = np.concatenate([bound, self._bound(loop, new)])[place]
            omega = np.concatenate([omega, new])[place]
        return omega, bound

    def linear(self, x: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
        """Bounds (F,) at frequencies and their gradients (F, k) with the parameters."""
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
        """The round that ends at x, with its bounds (F,)."""
        return Iterate(float(bound.max()), np.nan, np.nan, self.family.system(x))

    def _bound(self, loop: StateSpace, omega: RealArray) -> RealArray:
        value: RealArray = upper_bound(response(loop, omega), self.structure).value
        return value


def _beside(omega: RealArray, bound: RealArray) -> RealArray:
    """Frequencies on either side of maxima that are not resolved."""
    top = bound.max()
    left = np.concatenate([[0.0], bound[:-1]])
    right = np.concatenate([bound[1:], [0.0]])
    peak = (bound >= left) & (bound >= right) & (bound > TOP * top)
    steep = np.abs(np.diff(bound)) > FLAT * top
    wanted = steep & (peak[1:] | peak[:-1])
    middle: RealArray = np.sqrt(omega[1:] * omega[:-1])[wanted]
    return middle


def _minimised(
    problem: _Problem, x: RealArray, context: Context, target: float
) -> tuple[list[Iterate], str]:
    """The rounds, each better than the one before, and why they ended."""
    radius, hessian = FIRST, np.zeros((x.size, x.size))
    kept = context.checkpoint.load()
    if kept is not None:
        x, radius, hessian = kept["x"], float(kept["radius"]), kept["hessian"]
    loop = problem.loop(x)
    assert loop is not None  # a start stabilises, as its Program has seen
    omega, bound = problem.curve(loop)
    history = unpacked(kept) if kept is not None else [problem.iterate(x, bound)]
    for number, each in enumerate(history, start=1):
        context.record(each.row(number))
    for _ in context.rounds(ROUNDS, "fixed structure", len(history) - 1):
        peak = history[-1].peak
        if peak <= target:
            return history, "reached the target"
        units = problem.family.units(x)
        near = omega[bound > NEAR * peak]
        value, slope = problem.linear(x, near)
        step = None
        while radius > SMALLEST:
            scaled = hessian * units[:, None] * units
            step, level, weights = _step(scaled, slope * units, value, radius)
            promised = peak - level
            if promised < 1e-6 * peak:
                return history, "no step promises less"
            trial = x + units * step
            loop = problem.loop(trial)
            if loop is not None:
                omega_, bound_ = problem.curve(loop)
                share = (peak - float(bound_.max())) / promised
                if share > TAKEN:
                    break
            radius = 0.35 * min(radius, float(np.abs(step).max()))
        else:
            return history, "no step lowers the peak"
        _, slope_ = problem.linear(trial, near)
        hessian = _updated(hessian, trial - x, (slope_ - slope).T @ weights)
        at_bound = float(np.abs(step).max()) > 0.8 * radius
        if share > GROWN and at_bound:
            radius = min(2.5 * radius, LARGEST)
        elif share < SHRUNK:
            radius *= 0.5
        x, omega, bound = trial, omega_, bound_
        history.append(problem.iterate(x, bound))
        context.record(history[-1].row(len(history)))
        earlier = history[:-PATIENCE]
        if earlier and history[-1].peak > (1 - SETTLED) * earlier[-1].peak:
            return history, "settled"
        state = {"x": x, "radius": np.array(radius), "hessian": hessian}
        context.checkpoint.save(state | packed(history))
    return history, f"stopped after {ROUNDS} rounds"


def _step(
    hessian: RealArray, slope: RealArray, value: RealArray, radius: float
) -> tuple[RealArray, float, RealArray]:
    """The step d that minimises max(value + slope d) + d H d / 2 in a box, the level of the
    maximum, and the weights of the values in it."""
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
    """Powell's damped BFGS update of the Hessian by a step and the gradient's change along it."""
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
