"""Sets of transition matrices: bounds of quadratic functions over a set, and sets of held plants.

A set is {sum w_v A_v + R: w_v >= 0, sum w_v = 1, |R| <= S entry by entry}: the convex hull of
vertices plus a remainder. Since a norm is convex, a vertex attains its largest value over the hull.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.linalg import expm

from workbench.arrays import RealArray
from workbench.errors import InputError
from workbench.synthesis.switching.quadratic_functions import outward

OUTWARD_ROUNDING = 1e-9
"""Share by which bounds are rounded up."""
EXPONENTIAL_ROUNDING = 1e-14
"""Relative rounding error of a matrix exponential, for entries up to `LARGEST_MATRIX_ENTRY`."""
LARGEST_MATRIX_ENTRY = 10.0
"""Largest entry of a matrix whose exponential is computed."""


@dataclass(frozen=True, eq=False)
class TransitionSet:
    """A set with ``vertices`` A_v (V, n, n) and ``remainder`` S (n, n).

    Raises InputError for other sizes, entries that are not finite, and a negative remainder.
    """

    vertices: RealArray
    remainder: RealArray

    def __post_init__(self) -> None:
        n = self.vertices.shape[-1]
        if self.vertices.ndim != 3 or self.vertices.shape[1:] != (n, n):
            raise InputError(f"vertices have shape {self.vertices.shape}; need (V, n, n)")
        if self.remainder.shape != (n, n):
            raise InputError(f"the remainder has shape {self.remainder.shape}; need ({n}, {n})")
        if not (np.isfinite(self.vertices).all() and np.isfinite(self.remainder).all()):
            raise InputError("vertices or remainder have entries that are not finite")
        if (self.remainder < 0.0).any():
            raise InputError("the remainder bounds magnitudes; it must not be negative")

    def ratio(self, P: RealArray, Q: RealArray) -> float:
        """Upper bound of the ratio of (A x)' Q (A x) to x' P x over the set and all x.

        Raises InputError unless P and Q are positive definite.
        """
        try:
            root_P, root_Q = np.linalg.cholesky(P), np.linalg.cholesky(Q)
        except np.linalg.LinAlgError:
            raise InputError("P and Q must be positive definite") from None
        back = np.linalg.inv(root_P.T)
        hull = np.linalg.norm(root_Q.T @ self.vertices @ back, 2, axis=(-2, -1)).max()
        rest = np.linalg.norm(abs(root_Q.T) @ self.remainder @ abs(back), 2)
        return float((1.0 + OUTWARD_ROUNDING) * outward(P) * (hull + rest) ** 2)


def held_set(centre: Any, slopes: Sequence[Any], duration: float) -> TransitionSet:
    """A set that contains exp(h (M_0 + sum d_i M_i)) for all |d_i| <= 1.

    Its vertices are those of the linear part, and its remainder bounds the rest. With
    M = [A B; 0 0] it describes a plant whose inputs are held over h. Let X = h M_0 and
    Y = h sum d_i M_i, and let L be the part of the exponential that is linear in Y. Then

        |exp(X + Y) - exp(X) - L(X, Y)| <= exp(|X| + |Y|) - exp(|X|) - L(|X|, |Y|)

    entry by entry, also for matrices that do not commute, since every product in the series is at
    most the product of the magnitudes. |Y| is at most h sum |M_i|.

    Parameters
    ----------
    centre, slopes
        M_0 and M_i, each (n, n).
    duration
        Duration h [s].

    Raises
    ------
    InputError
        A matrix is not finite, of another size or badly scaled; or the duration is not positive.
    """
    M, parts = np.asarray(centre, float), [np.asarray(each, float) for each in slopes]
    n = len(M)
    if any(each.shape != (n, n) or not np.isfinite(each).all() for each in (M, *parts)):
        raise InputError(f"centre and slopes must be finite and ({n}, {n})")
    if not 0.0 < duration < math.inf:
        raise InputError(f"duration is {duration}; it must be positive and finite")
    X, steps = duration * M, [duration * Y for Y in parts]
    if abs(X).max(initial=0.0) > LARGEST_MATRIX_ENTRY:
        raise InputError(
            f"an entry of duration times centre is {abs(X).max():.3g}; scale states and inputs so "
            f"that none is above {LARGEST_MATRIX_ENTRY:g}, or the rounding is not bounded"
        )
    zero = np.zeros((n, n))
    linear = [_derivative(X, Y) for Y in steps]
    corners = product((-1.0, 1.0), repeat=len(steps))
    start = expm(X)
    vertices = np.array(
        [start + sum((d * L for d, L in zip(c, linear, strict=True)), zero) for c in corners]
    )
    size, far = abs(X), sum((abs(Y) for Y in steps), zero)
    grown, base = expm(size + far), expm(size)
    rounding = EXPONENTIAL_ROUNDING * grown
    remainder = np.maximum(grown - base - _derivative(size, far), 0.0) + rounding
    return TransitionSet(vertices, (1.0 + OUTWARD_ROUNDING) * remainder)


def _derivative(X: RealArray, Y: RealArray) -> RealArray:
    """Derivative of the exponential at X in the direction Y: a block of exp([X Y; 0 X])."""
    n = len(X)
    whole = expm(np.block([[X, Y], [np.zeros((n, n)), X]]))
    corner: RealArray = whole[:n, n:]
    return corner
