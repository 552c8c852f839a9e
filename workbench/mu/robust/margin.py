"""Robust stability of an uncertain system: how much uncertainty it bears, and what breaks it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workbench.certify.stable_system import angular_frequency, stable_system
from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.input_checks import is_real, need_positive, need_tolerance
from workbench.mu.frequency.attained import destabilised
from workbench.mu.frequency.peak import Peak, peak
from workbench.mu.robust.channels import even_channels
from workbench.mu.robust.destabilising import destabilising
from workbench.structure import Full, Real
from workbench.systems.bilinear import bilinear_sampled
from workbench.systems.realisation import realisation, worst_pole
from workbench.uncertainty.algebra.delays import DelayElement
from workbench.uncertainty.algebra.elements import DynamicElement
from workbench.uncertainty.algebra.lft import INTEGRATOR, LFT
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain

COMPLEX_SHARE = 1e-3
"""Complex part of the parameters in the proof, where all elements are real."""
REACH = 2.0
"""Multiple of the real part of a worst perturbation up to which an unstable one is looked for."""
BISECTIONS = 40
"""Most sizes of uncertainty that are tried for a margin of performance."""
MOST_GROWTH = 1e6
"""A margin beyond this, or below its reciprocal, is looked for no further."""


@dataclass(frozen=True, eq=False)
class StabilityMargin:
    """Bounds of the factor by which all uncertainty may grow before the system is unstable.

    Stability is proven for every perturbation smaller than ``lower``. ``worst`` is a perturbation
    of size ``upper``, by name, that makes the system unstable at ``omega`` [rad/s]: values of
    parameters, and dynamics as systems (None where no perturbation was found, and ``upper`` is
    infinite). Above 1 the system is stable for all of its uncertainty.
    """

    lower: float
    upper: float
    omega: float
    worst: Mapping[str, Any] | None
    peak: Peak

    def __repr__(self) -> str:
        verdict = "not decided for all of its uncertainty"
        if self.lower > 1:
            verdict = "stable for all of its uncertainty"
        elif self.upper < 1:
            verdict = "NOT stable for all of its uncertainty"
        lines = [
            f"StabilityMargin: from {self.lower:.5g} to {self.upper:.5g}, {verdict}",
            f"  at {self.omega:.5g} rad/s",
        ]
        for name, value in (self.worst or {}).items():
            order = getattr(value, "nstates", None)
            shown = f"{value:.6g}" if order is None else f"a system of order {order}"
            lines.append(f"  worst {name}: {shown}")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class PerformanceMargin:
    """Bounds of the factor by which all uncertainty may grow before a gain exceeds its level.

    For every perturbation of a size up to ``lower`` the largest gain is proven to stay below
    ``gain``; for some of size ``upper`` it is proven to reach it, at ``omega`` [rad/s]. Both are 0
    where the nominal gain reaches the level.
    """

    lower: float
    upper: float
    omega: float
    gain: float

    def __repr__(self) -> str:
        return (
            f"PerformanceMargin: gain below {self.gain:g} for uncertainty up to {self.lower:.5g} "
            f"to {self.upper:.5g} times its size, at {self.omega:.5g} rad/s"
        )


def robust_stability(
    system: Any,
    tolerance: float = 1e-4,
    *,
    decay: float = 0.0,
    complex_part: float = COMPLEX_SHARE,
) -> StabilityMargin:
    """Certified margin of robust stability of an uncertain system, such as a closed loop.

    Where all elements are real, mu is not continuous over frequency. Then each parameter gets a
    small complex part in the proof of the lower bound, which holds without it too and is smaller
    for it; the worst perturbation is real.

    Parameters
    ----------
    system
        An `UncertainSystem`, stable at its nominal; or what stands for one.
    tolerance
        As in `peak`.
    decay
        A rate [1/s]: poles must lie left of -decay (sampled: within exp(-decay T)) and not only
        left of the axis, so that whatever moves falls as fast. For systems without dynamics, whose
        gain is known on the axis only.
    complex_part
        Complex part, as a share of every parameter, where all elements are real. Where nothing is
        proven with it, ten times as much is tried.

    Raises
    ------
    InputError
        The system has no uncertain element, or is unstable at its nominal.
    """
    import control

    found = _analysed(_slowed(uncertain(system, "system"), decay))
    structure = found.structure
    N, period = even_channels(found.system, structure)
    real = all(isinstance(block, Real) for block in structure)
    bounds = peak(N, structure, tolerance, complex_part=complex_part if real else 0.0)
    if real and math.isinf(bounds.upper):
        bounds = peak(N, structure, tolerance, complex_part=10 * complex_part)
    lower = 1 / bounds.upper if bounds.upper > 0 else math.inf
    omega = angular_frequency(bounds.omega, period)
    if not bounds.lower > 0:
        return StabilityMargin(lower, math.inf, omega, None, bounds)
    if real:  # what has a complex part is none of the set's perturbations
        best = destabilised(stable_system(N), structure, np.real(bounds.Delta), reach=REACH)
        if not best.value > 0:
            return StabilityMargin(lower, math.inf, omega, None, bounds)
        Delta = control.ss([], [], [], best.Delta.real)
        worst, omega = values_of(found, Delta), angular_frequency(best.omega, period)
        return StabilityMargin(lower, 1 / best.value, omega, worst, bounds)
    Delta = destabilising(bounds, N, structure)
    worst = values_of(found, bilinear_sampled(Delta, period) if period else Delta)
    return StabilityMargin(lower, 1 / bounds.lower, omega, worst, bounds)


def robust_performance(
    system: Any, gain: float = 1.0, tolerance: float = 1e-3
) -> PerformanceMargin:
    """Certified factor by which all uncertainty may grow before the largest gain exceeds a level.

    The gain is the largest singular value over all frequencies. It stays below the level for every
    perturbation of a size up to t exactly where mu of the system, its perturbation times t and its
    outputs over the level, is below 1; t is found by bisection.

    Parameters
    ----------
    system
        An `UncertainSystem`, stable at its nominal; or what stands for one.
    gain
        The level.
    tolerance
        Relative distance between the bounds.

    Raises
    ------
    InputError
        As `robust_stability`; the level is not positive.
    """
    need_positive(gain, "gain")
    need_tolerance(tolerance)
    found = _analysed(system)
    structure, given = found.structure, found.system
    closed = structure.with_performance(found.noutputs, found.ninputs)
    whole, period = even_channels(given, closed)

    def bounded(t: float) -> Peak:
        scale = np.ones(whole.noutputs)
        scale[: structure.columns], scale[structure.columns :] = t, 1 / gain
        N = realisation((whole.A, whole.B, scale[:, None] * whole.C, scale[:, None] * whole.D), 0.0)
        return peak(N, closed, tolerance / 4)

    low, high, omega = 0.0, math.inf, math.nan
    if (nominal := bounded(0.0)).upper >= 1.0:
        omega = angular_frequency(nominal.omega, period)
        return PerformanceMargin(0.0, 0.0 if nominal.lower >= 1 else math.inf, omega, gain)
    t = 1.0
    for _ in range(BISECTIONS):
        at = bounded(t)
        if at.upper < 1.0:
            low = max(low, t)
        elif at.lower >= 1.0:
            high, omega = min(high, t), at.omega
        else:  # between the bounds of mu itself: narrower ones decide no more than the tolerance
            below, above = t * (1 - tolerance / 4), t * (1 + tolerance / 4)
            low = max(low, below) if bounded(below).upper < 1.0 else low
            if (beyond := bounded(above)).lower >= 1.0:
                high, omega = min(high, above), beyond.omega
            break
        if high <= low * (1 + tolerance) or low > MOST_GROWTH or high < 1 / MOST_GROWTH:
            break
        if math.isinf(high):
            t = 2.0 * low
        elif low == 0.0:
            t = high / 2.0
        else:
            t = math.sqrt(low * high)
    return PerformanceMargin(low, high, angular_frequency(omega, period), gain)


def _slowed(found: UncertainSystem, decay: float) -> UncertainSystem:
    """The system with its poles moved to the right by a rate [1/s]."""
    if not is_real(decay) or not 0.0 <= decay < math.inf:
        raise InputError(f"decay is {decay!r}; a rate of 0 or more [1/s] is needed")
    if not decay:
        return found
    for one in found.elements.values():
        if isinstance(one, DynamicElement | DelayElement):
            raise InputError(
                f"{one.name} is dynamics, of which nothing is known left of the axis; decay is for "
                "systems with uncertain numbers only"
            )
    M, states = found.value.M.copy(), np.array([name == INTEGRATOR for name in found.value.names])
    place = np.flatnonzero(states)
    if found.dt:
        M[place] *= math.exp(decay * found.dt)
    else:
        M[place, place] += decay
    return replace(found, value=LFT(M, found.value.names))


def _analysed(system: Any) -> UncertainSystem:
    """The uncertain system; raises InputError for one whose robustness has no meaning."""
    found = uncertain(system, "system")
    if not found.elements:
        raise InputError("the system has no uncertain element; there is nothing to be robust to")
    worst, beyond = worst_pole(found.nominal)
    if beyond >= 0:
        raise InputError(f"the system is unstable at its nominal: it has a pole at {worst:.6g}")
    return found


def values_of(found: UncertainSystem, Delta: StateSpace) -> dict[str, Any]:
    """A perturbation as values of the elements, by name."""
    import control

    structure, values = found.structure, {}
    places = zip(
        found.elements.values(),
        structure,
        structure.row_slices,
        structure.column_slices,
        strict=True,
    )
    for element, block, out, into in places:
        first = (out, into)
        if not isinstance(block, Full):  # a repeated scalar: its first entry is its value
            first = (slice(out.start, out.start + 1), slice(into.start, into.start + 1))
        D = Delta.D[first]
        if isinstance(block, Real):
            values[element.name] = element.value(D[0, 0])
            continue
        part = control.ss(Delta.A, Delta.B[:, first[1]], Delta.C[first[0]], D)
        part = control.minreal(part, verbose=False) if part.nstates else part
        values[element.name] = element.value(part)
    return values
