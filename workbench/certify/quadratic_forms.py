"""Comparisons of quadratic functions V = x' P x, proven in ball arithmetic.

A basis X in which P is nearly the identity is computed in doubles; any regular basis would be
valid. Forms are transformed into it in balls, which loses little by rounding, and judged there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx
from scipy.linalg import eigh

from workbench._core.arrays import EPS, RealArray
from workbench.certify.modes.modal_form import real_balls, real_doubles
from workbench.certify.rounding import BALL_BITS, Enclosure, exact, positive_definite

EXCESSES = (2.0**-46, 2.0**-40, 2.0**-32, 2.0**-24, 2.0**-16)
"""Relative distances above the computed ratio that are tried as proven bounds. The first is 64
roundings of a double; each next one is tried where the forms are conditioned worse. Half or double:
bounds are as much nearer or farther; each is proven.
"""
LEAST_RATIO = 2.0**-200
"""Least ratio that is searched for. It keeps a product with it far above underflow. Half or double
changes nothing.
"""


def _symmetric(P: RealArray) -> RealArray:
    """The symmetric matrix of the form x' P x, rounded."""
    return (P + P.T) / 2


class QuadraticForm:
    """The form x' P x of the symmetric part of P (n, n), rounded, and a basis for it."""

    def __init__(self, P: RealArray) -> None:
        self.P = _symmetric(np.asarray(P, dtype=float))
        self.basis: arb_mat | None = None
        self.columns = np.zeros_like(self.P)
        diagonal = np.diagonal(self.P)
        if not (np.isfinite(self.P).all() and (diagonal > 0).all()):
            return
        size = np.sqrt(diagonal)
        try:
            root = np.linalg.cholesky(self.P / size[:, None] / size)
            self.columns = np.linalg.inv(root).T / size[:, None]
            self.basis = real_balls(self.columns)
        except (np.linalg.LinAlgError, ValueError):
            return

    def seen(self, form: RealArray, through: arb_mat | None = None) -> Enclosure:
        """The form y' F y of y = M x in the basis; M None: the identity."""
        assert self.basis is not None
        with ctx.workprec(BALL_BITS):
            y = self.basis if through is None else through * self.basis
            return real_doubles(y.transpose() * (real_balls(form) * y))

    @property
    def positive(self) -> bool:
        """Whether the form is proven to be positive for every x != 0."""
        return self.basis is not None and positive_definite(self.seen(self.P))

    def ratio_within(self, other: QuadraticForm, size: RealArray) -> float:
        """Upper bound as `ratio`, for every M whose entries have a modulus of at most ``size`` (n,
        n).

        With x = X z it is at most |z|' (|X|' S' |Q| S |X|) |z| over z' (X' P X) z.
        """
        if self.basis is None:
            return np.inf
        if not size.any():
            return 0.0
        below, unit = self.seen(self.P), exact(np.eye(len(self.P)))
        with ctx.workprec(BALL_BITS):
            y = real_balls(size) * real_balls(np.abs(self.columns))
            above = real_doubles(y.transpose() * (real_balls(np.abs(other.P)) * y))
        largest = float(np.linalg.eigvalsh((above.mid + above.mid.T) / 2)[-1])
        for excess in EXCESSES:
            bound, share = largest * (1.0 + excess), 1.0 - excess
            at_most = positive_definite(unit.times(bound) - above)
            if at_most and positive_definite(below - unit.times(share)):
                return bound / share * (1.0 + 4 * EPS)
        return np.inf

    def ratio(self, other: QuadraticForm, through: arb_mat) -> float:
        """Upper bound of y' Q y / x' P x over all x, with y = M x; infinite if none is proven.

        Q is the form ``other``, M the balls ``through``.
        """
        if self.basis is None:
            return np.inf
        below, above = self.seen(self.P), self.seen(other.P, through)
        if not (below.finite and above.finite):
            return np.inf
        estimate = max(float(eigh(above.mid, below.mid, eigvals_only=True)[-1]), LEAST_RATIO)
        for excess in EXCESSES:
            bound = estimate * (1.0 + excess)
            if positive_definite(below.times(bound) - above):
                return bound
        return np.inf


def power(A: RealArray, exponent: int, rate: float | None = None) -> Any:
    """A^exponent (n, n) in balls; with a rate, rate^(exponent - 1) A instead."""
    with ctx.workprec(BALL_BITS):
        balls = real_balls(A)
        if rate is None:
            return balls**exponent
        return balls * arb(rate) ** (exponent - 1)


def ball_product(A: RealArray, B: Any) -> Any:
    """A B for balls B."""
    with ctx.workprec(BALL_BITS):
        return real_balls(A) * B


def ball_quotient(A: RealArray, divisor: float) -> Any:
    """A divided by a number, in balls."""
    with ctx.workprec(BALL_BITS):
        return real_balls(A) / arb(divisor)
