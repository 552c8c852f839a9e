"""The largest gain of the difference of two systems, proven, with weights on both sides."""

from __future__ import annotations

import math

from workbench.certify.norms import certified_norm
from workbench.certify.realisations.parts import (
    boundary_part_error,
    difference_of,
    gain_apart,
)
from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.realisations.system_parts import parts_of
from workbench.systems.realisation import in_series, matrices_of, realisation

SAME_BOUNDARY = 1e-9
"""Share by which parts on the boundary of stability may differ and still be rounding of one."""


def difference_bound(
    system: StateSpace,
    other: StateSpace,
    leaving: StateSpace | None = None,
    entering: StateSpace | None = None,
) -> float:
    """A bound of the largest gain of W_o (G - H) W_i over all frequencies.

    Beside the parts with poles on the boundary of stability, which must agree up to rounding.
    Infinite where nothing proves one. Weights are stable; None is 1.
    """
    try:
        parts, its = parts_of(system), parts_of(other)
    except InputError:  # poles that rounding cannot tell from the boundary
        return math.inf
    if boundary_part_error(system, matrices_of(its.boundary)) > SAME_BOUNDARY:
        return math.inf
    dt = float(system.dt or 0.0)
    beside = parts.error + its.error
    beside += gain_apart(matrices_of(parts.antistable), matrices_of(its.antistable), dt, True)
    between = difference_of(matrices_of(parts.stable), matrices_of(its.stable))
    factor = 1.0
    if entering is not None:
        factor *= certified_norm(entering)
        between = in_series(matrices_of(entering), between)
    if leaving is not None:
        factor *= certified_norm(leaving)
        between = in_series(between, matrices_of(leaving))
    # The products of direct terms, and the sums of states of a series, are rounded.
    rounding = 1.0 + 1e-12
    return (certified_norm(realisation(between, dt)) + factor * beside) * rounding
