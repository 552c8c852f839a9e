"""Descents of the norm from a point: BFGS, gradient sampling, random hops, evolution, and
smoothing.
"""

from __future__ import annotations

import math

import numpy as np

from workbench._core.arrays import RealArray
from workbench.executor.clock import time_is_up
from workbench.synthesis.mu.structured.nonsmooth.bfgs import Valued, bfgs_end, sampled_end
from workbench.synthesis.mu.structured.nonsmooth.evolution import evolution_end
from workbench.synthesis.mu.structured.nonsmooth.smoothed import ipopt_minimum
from workbench.synthesis.mu.structured.norm.search import NormPoint
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.realisation import realisation

FIRST_STEPS, MOST_STEPS = 60, 400
"""Number of BFGS steps from every start, and from the starts that are continued."""
LED_ON = 1e-3
"""BFGS starts again if it has lowered the norm by more than this share."""
HOP_SPREADS = (0.05, 0.2, 0.5)
"""Standard deviations of random hops, in units of the parameters."""
POWERS, IPOPT_STEPS, IPOPT_RADIUS = (8.0, 32.0, 128.0, 512.0), 100, 2.0
"""Powers of the smoothed norm, used in turn; number of IPOPT steps; and largest distance in
units.
"""
GENERATIONS = 400
"""Number of generations of an evolution."""


def first_steps(point: NormPoint) -> NormPoint:
    """The end of the first steps of BFGS from a point."""
    y, _ = bfgs_end(point.scaled, np.zeros(len(point.x)), FIRST_STEPS)
    return min(point.moved(y), point, key=lambda one: one.value)


def by_bfgs(point: NormPoint) -> NormPoint:
    """The end of BFGS from a point, restarted in new units as long as this lowers the norm."""
    while True:
        y, _ = bfgs_end(point.scaled, np.zeros(len(point.x)), MOST_STEPS)
        new = point.moved(y)
        if not new.value < (1 - LED_ON) * point.value or time_is_up("BFGS"):
            return min(new, point, key=lambda one: one.value)
        point = new


def along_kinks(point: NormPoint, rng: np.random.Generator) -> NormPoint:
    """The end of gradient sampling from a point."""
    y, _ = sampled_end(point.scaled, np.zeros(len(point.x)), rng)
    return min(point.moved(y), point, key=lambda one: one.value)


def hopped(point: NormPoint, rng: np.random.Generator, count: int) -> NormPoint:
    """The best end of descents from random points, each around the best point so far."""
    for number in range(count):
        if time_is_up("hops"):
            break
        spread = HOP_SPREADS[number % len(HOP_SPREADS)]
        there = point.moved(spread * rng.normal(size=len(point.x)))
        if math.isfinite(there.value):
            point = min(by_bfgs(there), point, key=lambda one: one.value)
    return point


def by_evolution(point: NormPoint, rng: np.random.Generator) -> NormPoint:
    """The best point of an evolution."""
    y, _ = evolution_end(point.size, np.zeros(len(point.x)), rng, GENERATIONS)
    return min(point.moved(y), point, key=lambda one: one.value)


def by_smoothing(point: NormPoint) -> NormPoint:
    """The best end of IPOPT on smoothed norms, which approach the norm, at frequencies of the loop.

    The power mean (sum of s^p over singular values and frequencies)^(1/p) has no kinks, and tends
    to the largest of them.
    """
    for power in POWERS:
        if time_is_up("smoothed norm"):
            break
        y = ipopt_minimum(
            _smoothed(point, power), np.zeros(len(point.x)), IPOPT_STEPS, IPOPT_RADIUS
        )
        point = min(point.moved(y), point, key=lambda one: one.value)
    return point


def _smoothed(point: NormPoint, power: float) -> Valued:
    """The logarithm of the power mean as a function of a step in units from a point, and its
    gradient.
    """
    norm, units = point.norm, point.units
    loop = norm.closed(point.x)
    assert loop is not None
    omega = frequencies_of(realisation(loop, 0.0))

    def valued(y: RealArray) -> tuple[float, RealArray]:
        found = (
            None
            if time_is_up("smoothed norm")
            else norm.singular_values(point.x + units * y, omega)
        )
        if found is None:
            return math.inf, np.zeros(len(y))
        size, slopes = found
        top = float(size.max())
        share = (size / top) ** power
        value = math.log(top) + math.log(share.sum()) / power
        weights = share / share.sum() / np.maximum(size, np.finfo(float).tiny)
        return value, units * np.einsum("fs,fsk->k", weights, slopes)

    return valued
