"""Proven bound of the largest gain of the difference of two systems, with weights on both sides."""

from __future__ import annotations

import math

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.norms import certified_norm
from workbench.certify.realisations.modes_apart import gain_by_modes
from workbench.certify.realisations.parts import (
    boundary_part_error,
    difference_of,
    gain_apart,
)
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.realisations.system_parts import parts_of
from workbench.systems.balancing import speed
from workbench.systems.realisation import Matrices, in_series, matrices_of, realisation

SAME_BOUNDARY = 1e-9
"""Parts on the boundary of stability may differ by this share and still count as equal up to
rounding.
"""


def difference_bound(
    system: StateSpace,
    other: StateSpace,
    leaving: StateSpace | None = None,
    entering: StateSpace | None = None,
) -> float:
    """A bound of the largest gain of W_o (G - H) W_i over all frequencies.

    The parts with poles on the boundary of stability are left out; they must agree up to rounding.
    The bound is infinite if none is proven. Weights are stable; None is 1. First states that both
    systems share, decoupled from the rest, are left out.
    """
    system, other = _without_shared_states(system, other)
    if not system.dt:  # gains are the same in another unit of time, a power of two
        rate = speed(*matrices_of(system)[:3])
        system, other = _timed(system, rate), _timed(other, rate)
        leaving = None if leaving is None else _timed(leaving, rate)
        entering = None if entering is None else _timed(entering, rate)
    dt = float(system.dt or 0.0)
    stable, beside = (matrices_of(system), matrices_of(other)), 0.0
    if not (stability_check(system).holds and stability_check(other).holds):
        try:
            parts, its = parts_of(system), parts_of(other)
        except InputError:  # poles that rounding cannot tell from the boundary
            return math.inf
        if boundary_part_error(system, matrices_of(its.boundary)) > SAME_BOUNDARY:
            return math.inf
        beside = parts.error + its.error
        antistable = matrices_of(parts.antistable), matrices_of(its.antistable)
        beside += gain_apart(*antistable, dt, True)
        stable = matrices_of(parts.stable), matrices_of(its.stable)
    between, factor = difference_of(*stable), 1.0
    if entering is not None:
        factor *= certified_norm(entering)
        between = in_series(matrices_of(entering), between)
    if leaving is not None:
        factor *= certified_norm(leaving)
        between = in_series(between, matrices_of(leaving))
    # The products of direct terms, and the sums in a series connection, are rounded.
    rounding = 1.0 + 1e-12
    gain = certified_norm(realisation(between, dt))
    if not math.isfinite(gain):  # poles of both that rounding can hardly separate
        gain = factor * gain_by_modes(*stable, bool(dt))
    return (gain + factor * beside) * rounding


def _timed(system: StateSpace, rate: float) -> StateSpace:
    """The system with time measured in units of 1 / rate."""
    A, B, C, D = matrices_of(system)
    return realisation((A / rate, B / rate, C, D), 0.0)


def _without_shared_states(one: StateSpace, other: StateSpace) -> tuple[StateSpace, StateSpace]:
    """The systems without the first states that they share and that are decoupled from the
    others.
    """
    parts = matrices_of(one), matrices_of(other)
    k = min(len(A) for A, _, _, _ in parts)
    while k and not (_shared(*parts, k) and all(_decoupled(A, k) for A, _, _, _ in parts)):
        k -= 1
    if not k:
        return one, other
    dt = float(one.dt or 0.0)
    left = [realisation((A[k:, k:], B[k:], C[:, k:], D), dt) for A, B, C, D in parts]
    return left[0], left[1]


def _shared(one: Matrices, other: Matrices, k: int) -> bool:
    (A, B, C, _), (A2, B2, C2, _) = one, other
    pairs = (A[:k, :k], A2[:k, :k]), (B[:k], B2[:k]), (C[:, :k], C2[:, :k])
    return all(np.array_equal(part, its) for part, its in pairs)


def _decoupled(A: RealArray, k: int) -> bool:
    return not A[:k, k:].any() and not A[k:, :k].any()
