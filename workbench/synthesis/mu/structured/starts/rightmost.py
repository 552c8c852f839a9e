"""Starts from a search over a family's parameters that moves the loop's rightmost pole to the
left.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import minimize

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import TimeLimitError
from workbench.synthesis.families.family import Family
from workbench.synthesis.families.modal import Modal
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.mu.structured.starts.search import Search
from workbench.systems.realisation import realisation

REAL_POLES_APART = 0.8
"""Ratio of the sizes of successive real poles that are slowed to meet a demand."""
SEARCHES, SEARCH_STEPS = 12, 200
"""Number of starts of the search, and number of steps from each."""
FAR_RIGHT = 1e6
"""Assumed rightmost pole of a loop that is not determined, relative to the plant's speed."""
LEAST_UNIT = 0.1
"""Least unit of a parameter in `Modal`, whose parameters are about one."""


def rightmost(search: Search) -> Iterator[StateSpace]:
    """Members for which the search has moved the loop's rightmost pole as far left as possible.

    The search starts from members that failed to stabilise, then from random ones.
    """
    if not search.family.examples(search.speed, search.gain):
        return
    for number in search.context.track(range(SEARCHES), "rightmost pole"):
        family, x, units = _start(search, number)
        yield family.system(_move_left(search, family, x, units))


def _move_left(search: Search, family: Family, x: RealArray, units: RealArray) -> RealArray:
    """Parameters with the rightmost pole farthest left, or the best ones so far if time is up."""
    demands = search.program.demands
    rows, sides = family.halfspaces(demands.stable, demands.fastest)
    scaled = rows * units if len(rows) else rows
    best, least = x / units, np.inf

    def abscissa(y: RealArray) -> float:
        nonlocal best, least
        search.context.seconds_left("rightmost pole")
        value = search.abscissa(family.system(y * units)) / search.speed
        if not np.isfinite(value):
            return FAR_RIGHT
        if value < least:
            best, least = y.copy(), value
        return value

    limits = [{"type": "ineq", "fun": lambda y: sides - scaled @ y}] if len(rows) else ()
    options = {"maxiter": SEARCH_STEPS}
    try:
        found = minimize(abscissa, best, method="SLSQP", constraints=limits, options=options)
    except TimeLimitError:
        return best * units
    final: RealArray = found.x * units
    return final


def _start(search: Search, number: int) -> tuple[Family, RealArray, RealArray]:
    """Family, parameters (k,) and their units (k,) at the start of a search."""
    tried, rng = search.missed[:SEARCHES], search.context.rng
    if isinstance(search.family, Modal):
        if number < len(tried):
            family, x = Modal.of(_with_allowed_poles(tried[number], search.program))
        else:
            family, x = _random_controller(search)
        return family, x, np.maximum(np.abs(x), LEAST_UNIT)
    if number < len(tried) // 2:
        own, x = search.family.about(tried[number])
        return own, x, _units(own, x, search.speed, search.gain)
    corner = search.speed * np.exp(rng.normal())
    examples = search.family.examples(corner, search.gain)
    own, x = search.family.about(examples[number % len(examples)])
    units = _units(own, x, corner, search.gain)
    return own, x + units * rng.normal(size=x.size), units


def _units(family: Family, x: RealArray, corner: float, gain: float) -> RealArray:
    """Steps (k,) that change the response at a corner by about `gain`; 1 for parameters without
    effect, and at least the family's units.
    """
    size = np.abs(family.response(x, np.array([corner]))[1]).max(axis=(0, 2, 3))
    by_slope = np.where(size > 0, gain / np.where(size > 0, size, 1.0), 1.0)
    return np.maximum(np.minimum(by_slope, 1e3 * family.units(x) + by_slope), family.units(x))


def _with_allowed_poles(K: StateSpace, program: MuSynthesis) -> StateSpace:
    """K with its poles mirrored and slowed to meet the demands."""
    values, V = np.linalg.eig(K.A)
    if not len(values):
        return K
    if program.demands.stable:
        size = np.maximum(np.abs(values), 1e-6)
        values = np.minimum(values.real, -1e-3 * size) + 1j * values.imag
    if program.demands.fastest is not None:
        # Real poles get different sizes, since equal ones cannot form a block.
        rank = np.cumsum(values.imag == 0) * (values.imag == 0)
        size = 0.99 * program.demands.fastest * REAL_POLES_APART**rank
        values = values * np.minimum(1.0, size / np.maximum(np.abs(values), 1e-12))
    A = np.real(V @ np.diag(values) @ np.linalg.inv(V))
    return realisation((A, K.B, K.C, K.D), 0.0)


def _random_controller(search: Search) -> tuple[Modal, RealArray]:
    """A random controller of the order with poles about as fast as those of the plant."""
    program, rng = search.program, search.context.rng
    assert isinstance(search.family, Modal)
    order, m, p = search.family.order, program.plant.measurements, program.plant.controls
    corners = search.speed * np.exp(rng.normal(size=(order + 1) // 2))
    if program.demands.fastest is not None:
        corners = np.minimum(corners, 0.5 * program.demands.fastest)
    family = Modal(order, corners=tuple(map(float, corners)), inputs=m, outputs=p)
    x = rng.normal(size=order + order * m + p * (order + m))
    x[:order] = np.abs(x[:order]) + 0.1
    return family, x
