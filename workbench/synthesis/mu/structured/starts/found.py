"""Starts of method "fixed": a D-K controller reduced, or a search for the rightmost pole."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
from scipy.optimize import minimize

from workbench.arrays import RealArray
from workbench.certify.stability import stability_of
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.heavy_types import StateSpace
from workbench.synthesis.mu.dk import iterated
from workbench.synthesis.mu.families import Modal
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.reduction import truncation
from workbench.synthesis.reduction.kept_part import kept_and_stable
from workbench.systems.realisation import Matrices, realisation

DETOUR = 6
"""States above the wanted order from which a reduction starts again at most."""
REDUCED_STARTS, ALIKE = 2, 0.02
"""Number of reductions that descent starts from, and the relative distance of their peaks."""
REAL_POLES_APART = 0.8
"""Ratio of the sizes of real poles that are slowed to what is asked."""
SEARCHES, SEARCH_STEPS, MOST_SEARCHED = 12, 200, 4
"""Random starts of the search for the rightmost pole, steps of each, and how many are compared."""


def found_starts(program: MuSynthesis, context: Context) -> tuple[list[StateSpace], str]:
    """Controllers of the wanted order that stabilise and meet the demands, and how they were found.

    They are the best approximations of a D-K controller and, where the plant is stable, one that
    does nothing; where no approximation will do, one from a search for the rightmost pole too.
    Descent ends at other places from each.

    Raises SolverError where none was found.
    """
    tried = list(_reduced(program, context))
    admitted = [K for K in tried if _holds(program, K)]
    found: list[StateSpace] = []
    said: list[str] = []
    if admitted:
        found += _best(program, admitted)
        said.append("a D-K controller, reduced")
    else:  # from there descent reaches what it does not reach from zero
        search = (K for K in _searched(program, tried, context) if _holds(program, K))
        found += _best(program, list(islice(search, MOST_SEARCHED)))
        said += ["a search for the rightmost pole"] * bool(found)
    idle = _idle(program)
    if _holds(program, idle):
        found.append(idle)
        said.append("zero")
    if not found:
        met = " and meets the demands" if program.stable or program.fastest_pole else ""
        raise SolverError(
            f"no controller of order {program.order} that stabilises{met} was found in {SEARCHES} "
            "searches: give a start, or a higher order"
        )
    return found, f"started from {' and from '.join(said)}"


def _idle(program: MuSynthesis) -> StateSpace:
    """A controller whose output is zero, with modes about as fast as the plant's."""
    order, plant = program.order or 0, program.plant
    rates = _speed(program) * np.geomspace(0.3, 3.0, max(order, 1))[:order]
    if program.fastest_pole is not None:
        rates = np.minimum(rates, 0.9 * program.fastest_pole * REAL_POLES_APART ** np.arange(order))
    return realisation(
        (
            -np.diag(rates),
            np.zeros((order, plant.measurements)),
            np.zeros((plant.controls, order)),
            np.zeros((plant.controls, plant.measurements)),
        ),
        0.0,
    )


def _speed(program: MuSynthesis) -> float:
    """The middle size of the plant's poles [rad/s]."""
    size = np.abs(program.plant.system.poles())
    size = size[size > 0]
    return float(np.exp(np.mean(np.log(size)))) if size.size else 1.0


def _holds(program: MuSynthesis, K: StateSpace) -> bool:
    return program.demands.admits(K) and bool(stability_of(program.plant.close(K)).holds)


def _best(program: MuSynthesis, controllers: list[StateSpace]) -> list[StateSpace]:
    """The `REDUCED_STARTS` controllers of least peaks that are not alike."""
    found: list[StateSpace] = []
    least = 0.0
    for peak, place in sorted((_peak(program, K), i) for i, K in enumerate(controllers)):
        if peak > (1 + ALIKE) * least and len(found) < REDUCED_STARTS:
            found.append(controllers[place])
            least = peak
    return found


def _peak(program: MuSynthesis, K: StateSpace) -> float:
    found = program.certified(K, 0.05)
    return np.inf if found is None else found.upper


def _reduced(program: MuSynthesis, context: Context) -> Iterator[StateSpace]:
    """Approximations of a D-K controller with the wanted order, and zero of that order."""
    order = program.order or 0
    try:
        left = context.seconds_left("D-K for a start")
        options = replace(context.options, time_limit=None if np.isinf(left) else max(left, 1e-3))
        answer, _, _ = iterated(program.without_demands(), Context(options), 0.0)
    except (SolverError, InputError):
        answer = None
    if answer is None:
        return
    K = answer.K
    if K.nstates <= order:
        yield K
        return
    parts: Matrices = (K.A, K.B, K.C, K.D)
    loop = program.plant.close(K)
    closed: Matrices = (loop.A, loop.B, loop.C, loop.D)
    ways: list[tuple[int, Callable[[int], Matrices]]] = [
        (0, truncation.weighted(parts, program.plant, closed, answer.peak)),
        truncation.balanced_truncation(kept_and_stable(parts)),
        truncation.matchdc(kept_and_stable(parts)),
        truncation.hankel(kept_and_stable(parts)),
    ]
    for least, way in ways:
        if least <= order:
            yield _system(way(order))
    for higher in range(order + 1, min(order + DETOUR, K.nstates - 1) + 1):
        for least, way in ways:
            if least > higher:
                continue
            fewer, again = truncation.balanced_truncation(kept_and_stable(way(higher)))
            if fewer <= order:
                yield _system(again(order))


def _system(parts: Matrices) -> StateSpace:
    return realisation(parts, 0.0)


def _searched(
    program: MuSynthesis, tried: list[StateSpace], context: Context
) -> Iterator[StateSpace]:
    """Controllers for which the loop's rightmost pole was moved left, from several starts."""
    plant, order = program.plant, program.order or 0
    speed = _speed(program)
    for number in context.track(range(SEARCHES), "rightmost pole"):
        if number < len(tried):
            family, x = Modal.of(_tamed(tried[number], program))
        else:
            family, x = _drawn(program, order, speed, context.rng)
        rows, sides = family.halfspaces(program.demands.stable, program.demands.fastest)
        units = np.maximum(np.abs(x), 0.1)

        def rightmost(y: RealArray, family: Modal = family, units: RealArray = units) -> float:
            return float(np.max(plant.close(family.system(y * units)).poles().real)) / speed

        limits = [{"type": "ineq", "fun": lambda y, G=rows * units, h=sides: h - G @ y}]
        found = minimize(
            rightmost,
            x / units,
            method="SLSQP",
            constraints=limits if len(rows) else (),
            options={"maxiter": SEARCH_STEPS},
        )
        yield family.system(found.x * units)


def _tamed(K: StateSpace, program: MuSynthesis) -> StateSpace:
    """K with its poles mirrored and slowed to what is asked."""
    values, V = np.linalg.eig(K.A)
    if not len(values):
        return K
    if program.demands.stable:
        size = np.maximum(np.abs(values), 1e-6)
        values = np.minimum(values.real, -1e-3 * size) + 1j * values.imag
    if program.demands.fastest is not None:
        # Real poles end at different places, since equal ones have no common block.
        rank = np.cumsum(values.imag == 0) * (values.imag == 0)
        size = 0.99 * program.demands.fastest * REAL_POLES_APART**rank
        values = values * np.minimum(1.0, size / np.maximum(np.abs(values), 1e-12))
    A = np.real(V @ np.diag(values) @ np.linalg.inv(V))
    return realisation((A, K.B, K.C, K.D), 0.0)


def _drawn(
    program: MuSynthesis, order: int, speed: float, rng: np.random.Generator
) -> tuple[Modal, RealArray]:
    """A random controller with poles about as fast as the plant."""
    plant = program.plant
    corners = speed * np.exp(rng.normal(size=(order + 1) // 2))
    if program.demands.fastest is not None:
        corners = np.minimum(corners, 0.5 * program.demands.fastest)
    family = Modal(tuple(map(float, corners)), plant.measurements, plant.controls, order)
    count = order + order * plant.measurements + plant.controls * (order + plant.measurements)
    x = rng.normal(size=count)
    x[:order] = np.abs(x[:order]) + 0.1
    return family, x
