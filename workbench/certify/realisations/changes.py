"""A proven bound of the change of a system's matrices that gives it the response of another system.

For regular V the system V A~ V^-1, V B~, C~ V^-1, D~ has the response of A~, B~, C~, D~. Its
distance from the given matrices is a backward error, computed in balls.
"""

from __future__ import annotations

import math

import numpy as np
from flint import arb, ctx

from workbench._core.arrays import RealArray
from workbench.certify.balls import above
from workbench.certify.modes.modal_form import real_balls
from workbench.certify.realisations.lyapunov import frobenius
from workbench.certify.rounding import BALL_BITS
from workbench.systems.realisation import Matrices


def relative_change(
    given: Matrices, other: Matrices, coordinates: RealArray, units: RealArray
) -> float:
    """A bound of the change of A, B, C or D, relative to its norm; infinite if none is proven.

    The change of D is relative to its norm plus the product of the norms of C and B, since a
    sampled response is the sum of both.

    Parameters
    ----------
    given, other
        A, B, C and D of two systems with as many states.
    coordinates
        V (n, n): the states of the given system are V times those of the other, nearly.
    units
        Factors (n,) of the given states in which changes are measured.
    """
    if not len(coordinates):
        return 0.0
    with ctx.workprec(BALL_BITS):
        rows, columns = (real_balls(np.diag(factors)) for factors in (units, 1.0 / units))
        A, B, C, D = (real_balls(part) for part in given)
        A0, B0, C0, D0 = (real_balls(part) for part in other)
        V = real_balls(coordinates)
        try:
            back = V.inv()
        except ZeroDivisionError:
            return math.inf
        entering, leaving = frobenius(rows * B), frobenius(C * columns)
        changes = (
            (rows * (A * V - V * A0) * back * columns, frobenius(rows * A * columns)),
            (rows * (B - V * B0), entering),
            ((C * V - C0) * back * columns, leaving),
            (D - D0, frobenius(D) + leaving * entering),
        )
        return max(_share(frobenius(change), size) for change, size in changes)


def _share(change: arb, whole: arb) -> float:
    """Upper bound of change / whole; 0 / 0 counts as 0."""
    if change == 0:
        return 0.0
    return above(change / whole) if whole > 0 else math.inf
