"""Hankel singular values of stable systems, each between proven bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer, no_better
from workbench.certificate import THIS_SYSTEM, Check, Checker
from workbench.certify.realisations.hankel import SHARP, enclosed_hankel_values
from workbench.certify.realisations.lyapunov import stability_proof
from workbench.errors import InputError
from workbench.realisations.stable_only import stable_states
from workbench.second_opinion.powers import SUM_ROUNDING, summed_hankel_values


@dataclass(frozen=True, eq=False, repr=False)
class HankelValues(Answer):
    """Hankel singular values lie between ``lower`` and ``upper`` (n,), the largest first.

    Examples
    --------
    >>> import control
    >>> from workbench.realisations import hankel_values
    >>> values = hankel_values(control.tf([1.0], [1.0, 3.0, 2.0]))
    >>> values.upper.round(4).tolist()
    [0.2968, 0.0468]
    """

    lower: RealArray
    upper: RealArray

    @property
    def error_bounds(self) -> RealArray:
        """Twice the sum of the values after the first k, for k = 0, 1, ... n (n + 1,).

        This is an upper bound of the largest gain of the difference to balanced truncation to k
        states.
        """
        sums = np.cumsum(np.append(0.0, self.upper[::-1]))[::-1]
        found: RealArray = 2.0 * sums * (1.0 + len(sums) * np.finfo(float).eps)
        return found


def hankel_values(system: Any) -> HankelValues:
    """The Hankel singular values of a stable system, each between proven bounds.

    They are the square roots of the eigenvalues of P Q, the product of the Gramians. They measure
    how much each state of a balanced realisation matters between input and output, and do not
    depend on coordinates. The bounds differ by about 1e-9 of a value, or by 1e-16 of the largest
    value if that is more.

    Parameters
    ----------
    system
        As of `gramians`.

    Raises
    ------
    InputError
        As `gramians`. For an unstable system, ask for the values of its stable part.

    Examples
    --------
    >>> import control
    >>> from workbench.realisations import hankel_values
    >>> values = hankel_values(control.tf([1.0], [1.0, 1.0]) + control.tf([1e-3], [1.0, 9.0]))
    >>> values.upper.round(7).tolist(), values.holds
    ([0.50002, 3.56e-05], True)

    References
    ----------
    K. Glover, All optimal Hankel-norm approximations of linear multivariable systems and their
    L-infinity-error bounds, Int. J. Control 39 (1984) 1115-1193; the proof is that of
    `workbench.certify.realisations.hankel`.
    """
    found = stable_states(system, "Hankel singular values")
    lower, upper = _bounds(found)
    # The claimed bounds are wider than the proven ones, whose last bits differ between processors.
    slack = (upper - lower) + SHARP * upper
    least = EPS * upper.max(initial=0.0)
    slack = np.where(upper > least, slack, slack + least)
    values = HankelValues(np.maximum(lower - slack, 0.0), upper + slack)
    return values.with_checker(HankelChecker(found))


def _bounds(system: StateSpace) -> tuple[RealArray, RealArray]:
    """Bounds of the values of a stable system."""
    A, B, C = (np.asarray(getattr(system, part), dtype=float) for part in "ABC")
    found = enclosed_hankel_values(A, B, C, float(system.dt or 0.0))
    if found is None:
        raise InputError(
            "the Hankel singular values cannot be enclosed: a pole lies so near to the boundary of "
            "stability, or the states are so nearly dependent, that doubles do not solve the "
            "Lyapunov equations; give a balanced or modal realisation"
        )
    return found


@dataclass(frozen=True, eq=False)
class HankelChecker(Checker):
    """Checks Hankel singular values by enclosed Gramians, and by sums over samples."""

    system: StateSpace

    @property
    def quantifier(self) -> str:
        return THIS_SYSTEM

    def checks(self, answer: HankelValues, tolerance: float) -> list[Check]:
        proven = _bounds(self.system)
        statement = "by which share a bound is better than the proven one"
        return [
            stability_proof(self.system),
            *no_better(answer, *proven, statement, 0.0),
        ]

    def second_opinion(self, answer: HankelValues) -> list[Check]:
        one = self.system
        values, rounding = summed_hankel_values(one.A, one.B, one.C, float(one.dt or 0.0))
        apart = np.maximum(values - answer.upper, answer.lower - values)
        scale = float(np.max(answer.upper, initial=0.0)) or 1.0
        statement = "distance of the values of sums over samples from the bounds, relative"
        far = float(apart.max(initial=0.0)) / scale
        return [Check("summed", statement, far, SUM_ROUNDING + rounding)]
