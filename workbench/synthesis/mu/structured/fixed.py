"""Mu synthesis over controllers with fixed structure by nonsmooth optimisation of their parameters.

The peak is a maximum over frequency of functions that are smooth almost everywhere, with known
gradients. A step minimises the largest of their linearisations at all frequencies near the peak,
plus half the quadratic form of a quasi-Newton Hessian, within a trust region. The step is accepted
if the loop is stable and the peak decreases.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.errors import InputError, TimeLimitError
from workbench.executor import Context, InProcess, spread
from workbench.executor.clock import time_is_up
from workbench.program import Claim, method
from workbench.solvers import Options, Outcome
from workbench.synthesis.families.modal import Modal
from workbench.synthesis.mu.finish import Finish
from workbench.synthesis.mu.program import PEAK_TOLERANCE, MuSynthesis
from workbench.synthesis.mu.quasi_newton import updated_hessian
from workbench.synthesis.mu.rounds import Iterate, packed, unpacked
from workbench.synthesis.mu.structured.minimax_step import known_units, minimax_step
from workbench.synthesis.mu.structured.norm.ends import search_ends
from workbench.synthesis.mu.structured.problem import PeakProblem
from workbench.synthesis.mu.structured.searches import limited_search
from workbench.synthesis.mu.structured.starts.found import NoStabilisingGainError, found_starts
from workbench.synthesis.mu.structured.starts.search import (
    DRAWS_PER_START,
    SHORTEST,
    START_SPREAD,
    Start,
)

MOST_STEPS, TRIAL_STEPS = 300, 8
"""Largest number of steps of the optimisation, and of a trial from each of several starts."""
FINALISTS, TRIAL_SHARE = 2, 0.5
"""Number of starts that are continued after the trials, and share of the remaining time for
trials.
"""
LOWERED_SHARE = 0.6
"""A step considers the bounds at all frequencies where they are above this share of the peak."""
FIRST_RADIUS, LARGEST_RADIUS, SMALLEST_RADIUS = 0.1, 2.0, 1e-8
"""Initial, largest and smallest trust radius, in units of the parameters."""
ACCEPTED_SHARE, SHRINKING_SHARE, GROWING_SHARE = 0.02, 0.25, 0.7
"""Shares of the promised fall above which a step is taken, below which the radius is halved, and
above which it may grow."""
GIVEN = "the given start"
"""What the rule of a start that is given is called."""
LEAST_PROMISE = 1e-6
"""Least predicted decrease of a step, relative to the peak."""
SETTLED_FALL, PATIENCE = 1e-4, 12
"""The optimisation is settled if the peak falls by less than this share over this number of
rounds."""


@method(MuSynthesis, "fixed", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _fixed(program: MuSynthesis, context: Context) -> Claim:
    """Nonsmooth optimisation over a family or an order, from a given start or found ones."""
    if program.structure is None and not _limited(program):
        return _norm_claim(program, context)
    return trust_region_claim(program, context)


def _limited(program: MuSynthesis) -> bool:
    """Whether there are several plants or a limit of the gain."""
    return bool(program.further_plants) or program.largest_gain is not None


def _norm_claim(program: MuSynthesis, context: Context) -> Claim:
    """The controller of the least H-infinity norm, which is the peak without a perturbation."""
    try:
        found = search_ends(program, context, (program.target or 0.0) / (1 + PEAK_TOLERANCE))
    except NoStabilisingGainError:
        return None, Outcome.INFEASIBLE, ""
    best = Iterate(found.best.value, np.nan, np.nan, found.best.controller)
    context.record(best.row(1))
    finish = Finish(program, context)
    return finish.claim([best], f"searched from {found.starts} starts")


def trust_region_claim(program: MuSynthesis, context: Context) -> Claim:
    """The best controller that steps within a trust region reach from the starts."""
    finish = Finish(program, context)
    try:
        history, said = _search(program, context, finish)
    except NoStabilisingGainError:
        return None, Outcome.INFEASIBLE, ""
    except TimeLimitError as error:
        history, said = [], finish.late(error)
    return finish.claim(history, said)


def _search(program: MuSynthesis, context: Context, finish: Finish) -> tuple[list[Iterate], str]:
    """The rounds that lead to the best controller found, and a message."""
    starts = _starts(program, context)
    if _limited(program):
        return limited_search(program, starts, context)
    target = (program.target or 0.0) / (1 + PEAK_TOLERANCE)
    rules = list(dict.fromkeys(start.rule for start in starts))
    if len(starts) > 1:
        starts = _best_after_trials(program, starts, context, target)
    (first, x), *others = [_problem(program, start.K) for start in starts]
    others += [(first, member) for member in _stable_members(first, x, program.random, context.rng)]
    peak = float(first.curve(first.stable_loop(x))[1].max())
    finish.offer(Iterate(peak, np.nan, np.nan, starts[0].K))
    context.progress(f"from {starts[0].rule}", 0, 1)
    minima = [_minimise_peak(first, x, context, target)]
    beside = partial(_minimise_peak_until, _time_at(context), target, MOST_STEPS)
    where = context.executor or InProcess()
    further = spread(beside, others, where, progress=context.progress, description="further starts")
    minima += [(unpacked(rounds), said) for rounds, said in further]
    best = min(range(len(minima)), key=lambda place: minima[place][0][-1].peak)
    history, said = minima[best]
    won = starts[best].rule if best < len(starts) else "a random one"
    return history, _message(rules, won) + said


def _best_after_trials(
    program: MuSynthesis, starts: list[Start], context: Context, target: float
) -> list[Start]:
    """The starts from which a few steps lead to the lowest peaks, moved to the ends of these
    steps.
    """
    problems = [_problem(program, start.K) for start in starts]
    trial = partial(_minimise_peak_until, _time_at(context, TRIAL_SHARE), target, TRIAL_STEPS)
    where = context.executor or InProcess()
    rules = ", ".join(dict.fromkeys(start.rule for start in starts))
    ended = spread(
        trial, problems, where, progress=context.progress, description=f"first steps from {rules}"
    )
    moved = []
    for start, (rounds, _) in zip(starts, ended, strict=True):
        last = unpacked(rounds)[-1]
        there = Start(last.K, start.rule, last.peak)
        try:
            _problem(program, there.K)
        except InputError:  # equal real poles cannot form a block
            there = replace(there, K=start.K)
        moved.append(there)
    return sorted(moved, key=lambda one: one.peak)[:FINALISTS]


def _time_at(context: Context, share: float = 1.0) -> float | None:
    """The time [s since the epoch] when a share of the remaining time has passed; None without a
    limit.
    """
    return None if np.isinf(context.remaining) else time.time() + share * context.remaining


def _starts(program: MuSynthesis, context: Context) -> list[Start]:
    """Controllers to start from: the given one, or those that are found."""
    if program.start is not None:
        failed = [c.name for c in program.demands.checks(program.start) if not c.holds]
        if failed:
            raise InputError(
                f"the start does not meet the demands on the controller: {'; '.join(failed)}"
            )
        return [Start(program.start, GIVEN)]
    if program.order is None and program.family is None:
        raise InputError(
            "it is unknown which controllers to search: give start, or order, or a family such "
            "as PID()"
        )
    return found_starts(program, context)


def _message(rules: list[str], won: str) -> str:
    """Message with the rules that found starts, and the rule of the start that led to the
    answer.
    """
    if rules == [GIVEN]:
        return ""
    more = f", best from {won}" if rules != [won] else ""
    return f"started from {' and from '.join(rules)}{more}; "


def _problem(program: MuSynthesis, start: StateSpace) -> tuple[PeakProblem, RealArray]:
    """Mu as a function of the parameters of the family, or of all controllers of the start's
    order.
    """
    family, x = (program.family or Modal(start.nstates)).about(start)
    if isinstance(family, Modal):
        x = _with_inputs_for_hidden_modes(family, x)
    return PeakProblem(program.plant, program.closed_structure, family, program.demands), x


def _with_inputs_for_hidden_modes(family: Modal, x: RealArray) -> RealArray:
    """The same controller, where modes without input and output get an input.

    If B and C of a mode are both zero, small steps of them have no effect.
    """
    n, m, p = family.order, family.inputs or 1, family.outputs or 1
    _, B, C, _ = np.split(x, np.cumsum([n, n * m, p * n]))
    B, C = B.reshape(n, m).copy(), C.reshape(p, n)
    for i in range(0, n, 2):
        part = slice(i, min(i + 2, n))
        if not B[part].any() and not C[:, part].any():
            B[part] = 1.0
    return np.concatenate([x[:n], B.ravel(), x[n + n * m :]])


def _stable_members(
    problem: PeakProblem, x: RealArray, count: int, rng: np.random.Generator
) -> Iterator[RealArray]:
    """Random parameters around x with stable loops; fewer than `count` if few loops are stable."""
    units = problem.family.units(x)
    found = 0
    for _ in range(DRAWS_PER_START * count):
        member = x + START_SPREAD * units * rng.normal(size=x.size)
        if found < count and problem.loop(member) is not None:
            found += 1
            yield member


def _minimise_peak(
    problem: PeakProblem, x: RealArray, context: Context, target: float, steps: int = MOST_STEPS
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
    for _ in context.rounds(steps, "fixed structure", first=len(history) - 1):
        peak = history[-1].peak
        if peak <= target:
            return history, "reached the target"
        found = _lowering_step(problem, x, (omega, bound), hessian, radius)
        if isinstance(found, str):
            if begun == len(history) - 1:
                return history, found
            # Restart without curvature: curvature from distant points, or poles in one block, may
            # hide a descent.
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
    return history, f"stopped after {steps} rounds"


def _minimise_peak_until(
    until: float | None, target: float, steps: int, begun: tuple[PeakProblem, RealArray]
) -> tuple[dict[str, NDArray[Any]], str]:
    """`_minimise_peak` that stops at a time [s since the epoch], also in another process; rounds as
    arrays.
    """
    left = None if until is None else max(until - time.time(), SHORTEST)
    history, said = _minimise_peak(*begun, Context(options=Options(time_limit=left)), target, steps)
    return packed(history), said


class _LoweringStep(NamedTuple):
    """Parameters with a lower peak, their curve (omega, bound), and data for the next step.

    `turned` is the change of the largest bound's gradient (k,).
    """

    x: RealArray
    curve: tuple[RealArray, RealArray]
    turned: RealArray
    next_radius: float


def _lowering_step(
    problem: PeakProblem,
    x: RealArray,
    curve: tuple[RealArray, RealArray],
    hessian: RealArray,
    radius: float,
) -> _LoweringStep | str:
    """The first accepted step within the trust radius or a smaller one; a message if there is
    none.
    """
    (omega, bound), units = curve, problem.family.units(x)
    peak = float(bound.max())
    near = omega[bound > LOWERED_SHARE * peak]
    value, slope = problem.linear(x, near)
    units = known_units(units, slope, peak)
    rows, sides = problem.family.halfspaces(problem.demands.stable, problem.demands.fastest)
    room = (rows * units, sides - rows @ x) if len(rows) else None
    while radius > SMALLEST_RADIUS:
        if time_is_up("step of the search"):
            return "no time for another step"
        scaled = hessian * units[:, None] * units
        step, level, weights = minimax_step(scaled, slope * units, value, radius, room)
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
                return _LoweringStep(trial, new, turned, radius)
        radius = 0.35 * min(radius, length)
    return "no step lowers the peak"
