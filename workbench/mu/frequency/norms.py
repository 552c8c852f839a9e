"""Proven bounds of norms of systems: H-infinity and H2."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.answer import REPEATED_ROUNDING, Answer, PartsChecker, no_better
from workbench.certificate import EVERY_FREQUENCY, THIS_SYSTEM, Check, Checker, relative_excess
from workbench.certify.eigenvalues import separate_pole_discs
from workbench.certify.realisations.energy import energy_bounds
from workbench.certify.rounding import exact
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.mu.frequency.peak import peak
from workbench.mu.frequency.peak_bounds import Peak
from workbench.second_opinion import peaks
from workbench.second_opinion.powers import root_energy
from workbench.structure import Full, Structure
from workbench.systems.balancing import speed, with_state_units
from workbench.systems.conversion import as_system
from workbench.systems.realisation import matrices_of

SUM_ROUNDING = 1e-6
"""Relative distance by which a sum over samples in plain doubles may lie outside the bounds. Sums
over thousands of samples in doubles have eight digits, and less for poles near the boundary. With
half of it a true bound may be contradicted; double overlooks an error of 2e-6.
"""
NORM_TOLERANCE = 1e-6
"""Default relative distance between the bounds of a largest gain. Users compare norms to six
digits. Half or double changes the time by little, and the seventh digit.
"""


@dataclass(frozen=True, eq=False, repr=False)
class SystemNorm(Answer):
    """The norm of a system lies between ``lower`` and ``upper``; both are infinite without one.

    ``omega`` [rad/s] is a frequency of the largest gain; NaN for an H2 norm, or if there is no
    norm.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import h2_norm, h_infinity_norm
    >>> lag = control.tf([3.0], [1.0, 2.0])
    >>> round(h_infinity_norm(lag).lower, 3), round(h2_norm(lag).upper, 3)
    (1.5, 1.5)
    """

    lower: float
    upper: float
    omega: float
    peak: Peak | None = field(default=None, kw_only=True)

    def __float__(self) -> float:
        """The upper bound."""
        return self.upper

    def summary(self) -> str:
        at = "" if math.isnan(self.omega) else f", at {self.omega:.6g} rad/s"
        return f"SystemNorm: from {self.lower:.8g} to {self.upper:.8g}{at}"


def h_infinity_norm(system: Any, *, tolerance: float = NORM_TOLERANCE) -> SystemNorm:
    """The largest gain of a system over all frequencies; infinite unless it is stable.

    Parameters
    ----------
    system
        A StateSpace, TransferFunction or other system with states, with any number of inputs and
        outputs, in continuous or sampled time.
    tolerance
        Relative distance of the bounds.

    Raises
    ------
    InputError
        The system is improper, or rounding hides whether a pole is stable.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import h_infinity_norm
    >>> norm = h_infinity_norm(control.tf([1.0], [1.0, 0.2, 1.0]))
    >>> bool(norm.lower <= 5 / 0.99**0.5 <= norm.upper), norm.holds
    (True, True)
    """
    found = as_system(system, "system")
    if not is_stable(found):
        return SystemNorm(math.inf, math.inf, math.nan).with_checker(UnstableChecker(found))
    bounds = peak(found, Structure([Full(found.ninputs, found.noutputs)]), tolerance=tolerance)
    norm = SystemNorm(bounds.lower, bounds.upper, bounds.omega, peak=bounds)
    return norm.with_checker(GainChecker())


def h2_norm(system: Any) -> SystemNorm:
    """The H2 norm: the root of the total energy of the impulse responses.

    It is also the root mean square of the outputs if all inputs are white noise of intensity 1
    (sampled: of variance 1). It is infinite unless the system is stable and, in continuous time,
    without a direct term.

    Parameters
    ----------
    system
        As of `h_infinity_norm`.

    Raises
    ------
    InputError
        As `h_infinity_norm`.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import h2_norm
    >>> norm = h2_norm(control.tf([1.0], [1.0, 2.0]))
    >>> bool(norm.lower <= 0.5 <= norm.upper), norm.holds
    (True, True)
    """
    found = as_system(system, "system")
    if not is_stable(found):
        return SystemNorm(math.inf, math.inf, math.nan).with_checker(UnstableChecker(found))
    lower, upper = _energy(found)
    return SystemNorm(lower, upper, math.nan).with_checker(EnergyChecker(found))


def is_stable(system: StateSpace) -> bool:
    """Whether all poles are proven to be stable; False where one is proven not to be.

    Raises
    ------
    InputError
        Rounding hides on which side of the boundary a pole lies.
    """
    stability = stability_check(system)
    if stability.holds:
        return True
    A = with_state_units(*matrices_of(system))[0]
    discs = separate_pole_discs(exact(A))
    centre = np.abs(discs.centre) - 1.0 if system.dt else discs.centre.real
    if (centre >= 0.0).any():
        return False
    raise InputError(
        f"a pole {stability.where} of the system lies within rounding of the boundary of stability"
    )


def _energy(system: StateSpace) -> tuple[float, float]:
    """Bounds of the H2 norm of a stable system."""
    dt, D = float(system.dt or 0.0), np.asarray(system.D, dtype=float)
    if D.any() and not dt:
        return math.inf, math.inf
    A, B, C, _ = matrices_of(system)
    # Time and signals are scaled by powers of two, so that squares stay within the range of
    # doubles.
    root = 1.0 if dt else float(np.exp2(np.round(np.log2(speed(A, B, C)) / 2)))
    A, B, C, D = with_state_units(A / root**2, B / root**2, C, D)
    entering, leaving = (np.ldexp(1.0, np.frexp(abs(part).max(initial=0.0))[1]) for part in (B, C))
    low, high = energy_bounds(A, B / entering, C / leaving, dt)
    direct = float(np.sum((D / entering / leaving) ** 2))
    rounding = 4.0 * D.size * np.finfo(float).eps
    low, high = low + direct * (1.0 - rounding), high + direct * (1.0 + rounding)
    ends = (math.sqrt(end) * entering * leaving * root for end in (low, high))
    least, most = (float(end) for end in ends)
    return float(np.nextafter(least, 0.0)), float(np.nextafter(most, math.inf)) if most else 0.0


class GainChecker(PartsChecker):
    """Checks an H-infinity norm as the peak of mu of one full complex block."""

    @property
    def quantifier(self) -> str:
        return EVERY_FREQUENCY

    def parts(self, answer: SystemNorm) -> Mapping[str, Peak | None]:
        return {"gain": answer.peak}

    def checks(self, answer: SystemNorm, tolerance: float) -> list[Check]:
        if answer.peak is None:
            return [Check("gain", "whether no peak proves it", 1.0, 0.0)]
        statement = "by which share it is better than the proven bound"
        return no_better(answer, answer.peak.lower, answer.peak.upper, statement, 0.0)


@dataclass(frozen=True, eq=False)
class UnstableChecker(Checker):
    """Checks that a system has no norm."""

    system: StateSpace

    @property
    def quantifier(self) -> str:
        return THIS_SYSTEM

    def checks(self, answer: SystemNorm, tolerance: float) -> list[Check]:
        finite = float(not math.isinf(answer.lower) or is_stable(self.system))
        return [Check("no norm", "whether it is stable, or a finite norm is claimed", finite, 0.0)]

    def second_opinion(self, answer: SystemNorm) -> list[Check]:
        return [peaks.one_unstable([self.system])]


@dataclass(frozen=True, eq=False)
class EnergyChecker(Checker):
    """Checks an H2 norm by the residual of its Lyapunov equation, and by a sum over samples."""

    system: StateSpace

    @property
    def quantifier(self) -> str:
        return THIS_SYSTEM

    def checks(self, answer: SystemNorm, tolerance: float) -> list[Check]:
        statement = "by which share the bound is better than the proven one"
        found = [stability_check(self.system)]
        return found + no_better(answer, *_energy(self.system), statement, REPEATED_ROUNDING)

    def second_opinion(self, answer: SystemNorm) -> list[Check]:
        if not 0.0 < answer.upper < math.inf:
            return []
        one = self.system
        size = root_energy(one.A, one.B, one.C, one.D, float(one.dt or 0.0))
        apart = max(relative_excess(size, answer.upper), relative_excess(answer.lower, size))
        statement = "distance of the sum over samples from the bounds, relative"
        return [Check("summed", statement, apart, SUM_ROUNDING, over=THIS_SYSTEM)]
