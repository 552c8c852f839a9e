"""Checks that numbers and code of an implemented controller agree with the given controller."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from workbench._core.arrays import ComplexArray
from workbench._core.heavy_types import StateSpace
from workbench.certificate import THIS_SYSTEM, Check, relative_excess
from workbench.synthesis.implementation.fixed_point import FixedCascade, FixedPoint
from workbench.synthesis.implementation.sampled_loop import SampledMargins
from workbench.systems.generalised_plant import response

FOLLOWED = {"double": 1e-6, "float": 1e-2, "fixed": 1e-2}
"""Largest change of a response by rounding of coefficients, relative to its gain. The formats round
by 1e-16, 1e-7 and by the given bits, and lightly damped poles amplify this.
"""
FREQUENCIES = 200
"""Number of frequencies at which responses are compared."""
SMALL_SHARE = 1e-3
"""Least gain used in relative differences, as a share of the largest gain."""
MARGIN_ROUNDING = 1e-6
"""Largest relative difference of a margin from the recomputed one."""


def follows(K: StateSpace, wanted: StateSpace, precision: str) -> Check:
    """Check that a sampled controller has the response of the controller that it implements."""
    nyquist = math.pi / float(wanted.dt)
    omega = nyquist * np.append(np.geomspace(1e-5, 1.0, FREQUENCIES, endpoint=False), 0.999)
    found, asked = response(K, omega), response(wanted, omega)
    size = _gain(asked)
    apart = _gain(found - asked) / np.maximum(size, SMALL_SHARE * size.max(initial=0.0) or 1.0)
    worst = int(np.argmax(np.where(np.isnan(apart), np.inf, apart)))
    return Check(
        "controller",
        "largest difference from the controller that was given, in its number format, relative",
        float(apart[worst]),
        FOLLOWED[precision],
        where=f"at {omega[worst]:.6g} rad/s",
        over=f"at {omega.size} frequencies",
    )


def margins_agree(claimed: Sequence[SampledMargins], again: Sequence[SampledMargins]) -> Check:
    """Check that margins agree with recomputed ones."""
    apart = 0.0 if len(claimed) == len(again) else math.inf
    for one, other in zip(claimed, again, strict=False):
        for a, b in zip(one.numbers, other.numbers, strict=True):
            if not (math.isnan(a) and math.isnan(b)):
                apart = max(
                    apart, relative_excess(max(a, b), min(a, b)) if a == a and b == b else math.inf
                )
    statement = "largest difference of a margin from the one found again, relative"
    return Check("margins", statement, apart, MARGIN_ROUNDING, over="for each control alone")


def integers_agree(fixed: FixedPoint) -> Check:
    """Check that the integers of the cascades are the coefficients of the controller."""
    apart = 0.0
    for line, rows_of in zip(fixed.cascades, fixed.quantised.channels, strict=True):
        for cascade, rows in zip(line, rows_of, strict=True):
            off = np.abs(_coefficients(cascade) - rows[:, [0, 1, 2, 4, 5]])
            apart = max(apart, float(off.max(initial=0.0)))
    statement = "largest difference of a coefficient from the integers that stand for it"
    return Check("integers", statement, apart, 0.0, over=THIS_SYSTEM)


def _coefficients(cascade: FixedCascade) -> np.ndarray:
    """Coefficients b0 b1 b2 a1 a2 of each section (L, 5), with the shifts undone."""
    shifted = np.diff(cascade.shifts, prepend=0)
    b = cascade.numerators * np.exp2(shifted - cascade.numerator_exponents)[:, None]
    a = cascade.denominators * np.exp2(-cascade.denominator_exponents.astype(float))[:, None]
    return np.hstack([b, a])


def _gain(M: ComplexArray) -> np.ndarray:
    """Largest singular values (F,) of M."""
    return np.asarray(np.linalg.norm(M, 2, axis=(-2, -1)))
