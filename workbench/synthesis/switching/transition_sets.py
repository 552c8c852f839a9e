"""Sets of transition matrices: bounds on quadratic functions over a set, and sets of plants with
hold.

A set is {sum w_v A_v + R: w_v >= 0, sum w_v = 1, |R| <= S entry by entry}: the convex hull of
vertices, plus a remainder. Since a norm is convex, its largest value over the hull is at a vertex.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx

from workbench._core.arrays import EPS, RealArray
from workbench.certify.modes.modal_form import real_balls, real_doubles
from workbench.certify.quadratic_forms import QuadraticForm, power
from workbench.certify.rounding import BALL_BITS
from workbench.errors import InputError

LARGEST_EXPONENT = 500.0
"""Largest norm of a matrix whose exponential is computed. Larger ones may overflow."""


@dataclass(frozen=True, eq=False)
class TransitionSet:
    """A set with ``vertices`` A_v (V, n, n) and ``remainder`` S (n, n).

    Raises InputError for wrong shapes, entries that are not finite, and a negative remainder.
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
        """Upper bound on (A x)' Q (A x) / x' P x over all A in the set and all x.

        Raises InputError unless P and Q are positive definite.
        """
        at_entry, after = QuadraticForm(P), QuadraticForm(Q)
        if not (at_entry.positive and after.positive):
            raise InputError("P and Q must be positive definite")
        hull = max(at_entry.ratio(after, power(A, 1)) for A in self.vertices)
        rest = at_entry.ratio_within(after, self.remainder)
        return (math.sqrt(hull) + math.sqrt(rest)) ** 2 * (1.0 + 8 * EPS)


def held_set(centre: Any, slopes: Sequence[Any], duration: float) -> TransitionSet:
    """A set that contains exp(h (M_0 + sum d_i M_i)) for all |d_i| <= 1.

    The vertices of the set are those of the part linear in d, and its remainder bounds the rest.
    With M = [A B; 0 0] the set describes a plant whose inputs are held for the time h. Let X = h
    M_0 and Y = h sum d_i M_i, and let L be the part of the exponential that is linear in Y. Then

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
    if n * duration * max(abs(each).max(initial=0.0) for each in (M, *parts)) > LARGEST_EXPONENT:
        raise InputError("duration times centre or slopes is so large that exponentials overflow")
    with ctx.workprec(BALL_BITS):
        h = arb(duration)
        X, steps = real_balls(M) * h, [real_balls(Y) * h for Y in parts]
        start, linear = X.exp(), [_derivative(X, Y) for Y in steps]
        corners = product((-1, 1), repeat=len(steps))
        zero = X * 0
        exact = [
            real_doubles(start + sum((L * d for d, L in zip(c, linear, strict=True)), zero))
            for c in corners
        ]
        size = real_balls(np.abs(M)) * h
        far = sum((real_balls(np.abs(Y)) * h for Y in parts), zero)
        rest = real_doubles((size + far).exp() - size.exp() - _derivative(size, far))
    rounding = np.max([each.rad for each in exact], axis=0)
    remainder = np.maximum(rest.mid + rest.rad, 0.0) + rounding
    return TransitionSet(np.array([each.mid for each in exact]), (1.0 + 4 * EPS) * remainder)


def _derivative(X: Any, Y: Any) -> Any:
    """Derivative of the matrix exponential at X in the direction Y, in ball arithmetic: a block of
    exp([X Y; 0 X]).
    """
    n = X.nrows()
    rows = [[*X.tolist()[i], *Y.tolist()[i]] for i in range(n)]
    rows += [[*([0] * n), *X.tolist()[i]] for i in range(n)]
    whole = arb_mat(rows).exp()
    return arb_mat([[whole[i, n + j] for j in range(n)] for i in range(n)])
