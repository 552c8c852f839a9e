"""The largest gain on the boundary of stability, for systems that need not be stable."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.answer import PartsChecker, no_better
from workbench.certificate import EVERY_FREQUENCY, THIS_SYSTEM, Check, Checker
from workbench.certify.eigenvalues import separate_pole_discs
from workbench.certify.proofs.numerator import stable_numerator
from workbench.certify.rounding import exact
from workbench.certify.stability import stability_check
from workbench.mu.frequency.norms import NORM_TOLERANCE, SystemNorm, h_infinity_norm
from workbench.mu.frequency.peak import peak
from workbench.mu.frequency.peak_bounds import Peak
from workbench.second_opinion import peaks
from workbench.structure import Full, Structure
from workbench.systems.balancing import with_state_units
from workbench.systems.conversion import as_system
from workbench.systems.realisation import matrices_of


def linf_norm(system: Any, *, tolerance: float = NORM_TOLERANCE) -> SystemNorm:
    """The largest gain of a system over all frequencies, whether or not it is stable.

    For a stable system it is the H-infinity norm. It is infinite if a pole lies on the imaginary
    axis (sampled: on the unit circle), or so near that rounding of the entries may put it there.

    Parameters
    ----------
    system
        As of `h_infinity_norm`.
    tolerance
        Relative distance of the bounds.

    Raises
    ------
    InputError
        It is improper, or an unstable pole does not show at its outputs.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import linf_norm
    >>> norm = linf_norm(control.tf([1.0], [1.0, -2.0]))
    >>> bool(norm.lower <= 0.5 <= norm.upper), norm.holds
    (True, True)

    References
    ----------
    S. Boyd, V. Balakrishnan, P. Kabamba, A bisection method for computing the H-infinity norm of a
    transfer matrix, Math. Control Signals Systems 2 (1989) 207-219, for the norm; the proof is that
    of `workbench.certify.proofs.numerator`.
    """
    found = as_system(system, "system")
    if stability_check(found).holds:
        return h_infinity_norm(found, tolerance=tolerance)
    if pole_on_boundary(found) is not None:
        return SystemNorm(math.inf, math.inf, math.nan).with_checker(BoundaryPoleChecker(found))
    numerator = stable_numerator(found)
    structure = Structure([Full(found.ninputs, found.noutputs)])
    bounds = peak(numerator.system, structure, tolerance=tolerance)
    lower, upper = numerator.enclosed(bounds.lower, bounds.upper)
    norm = SystemNorm(lower, upper, bounds.omega, peak=bounds)
    return norm.with_checker(AxisGainChecker(found))


def pole_on_boundary(system: StateSpace) -> complex | None:
    """A pole that may lie on the boundary of stability: a disc known to contain it meets the
    boundary.
    """
    A = with_state_units(*matrices_of(system))[0]
    discs = separate_pole_discs(exact(A))
    distance = np.abs(discs.centre) - 1.0 if system.dt else discs.centre.real
    touching = ~(np.abs(distance) > discs.radius + np.finfo(float).eps * np.abs(discs.centre))
    return complex(discs.centre[touching][0]) if touching.any() else None


@dataclass(frozen=True, eq=False)
class AxisGainChecker(PartsChecker):
    """Checks the largest gain of an unstable system by the peak of a stable system with the same
    gain.
    """

    system: StateSpace

    @property
    def quantifier(self) -> str:
        return EVERY_FREQUENCY

    def parts(self, answer: SystemNorm) -> Mapping[str, Peak | None]:
        return {"gain": answer.peak}

    def checks(self, answer: SystemNorm, tolerance: float) -> list[Check]:
        if answer.peak is None:
            return [Check("gain", "whether no peak proves it", 1.0, 0.0)]
        proven = stable_numerator(self.system).enclosed(answer.peak.lower, answer.peak.upper)
        statement = "by which share it is better than the bound proven of the stable numerator"
        return no_better(answer, *proven, statement, 0.0)

    def second_opinion(self, answer: SystemNorm) -> list[Check]:
        return [peaks.axis_gain(self.system, answer.lower, answer.upper, answer.omega)]


@dataclass(frozen=True, eq=False)
class BoundaryPoleChecker(Checker):
    """Checks that a system has a pole on the boundary of stability, up to rounding."""

    system: StateSpace

    @property
    def quantifier(self) -> str:
        return THIS_SYSTEM

    def checks(self, answer: SystemNorm, tolerance: float) -> list[Check]:
        finite = float(math.isfinite(answer.lower) or pole_on_boundary(self.system) is None)
        statement = "whether no pole is near the boundary, or a finite norm is claimed"
        return [Check("no norm", statement, finite, 0.0)]

    def second_opinion(self, answer: SystemNorm) -> list[Check]:
        return [peaks.one_unstable([self.system])]
