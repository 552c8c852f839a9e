"""Statements about a conic program that a rational ray proves, in exact arithmetic.

Let y be in the dual of K. Every x with b - A x in K satisfies y'(b - A x) >= 0, hence

    b'y >= (A'y)'x >= -sum |A'y| max |x|.

So where b'y < 0, no solution has max |x| < R = -b'y / sum |A'y|; and none exists if A'y = 0. The
bound for A'y not 0: C. Jansson, D. Chaykin, C. Keil, Rigorous error bounds for the optimal value in
semidefinite programming, SIAM J. Numer. Anal. 46 (2007) 180-200. Where A'y = -c, every solution has
c'x = -(A'y)'x >= -b'y.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from flint import fmpq

from workbench._core.arrays import RealArray
from workbench.certify.cones.form import ConicForm
from workbench.certify.cones.membership import Rational, fraction, outside
from workbench.certify.known_plants.exact_function import exact_rational


def excluded_radius(form: ConicForm, y: Sequence[Rational]) -> float:
    """Largest proven R such that no solution x of a form has max |x| < R, rounded downward.

    `math.inf` if y proves that there is no solution, 0 if it proves nothing.
    """
    if len(y) != form.b.size or outside(form, y, dual=True):
        return 0.0
    fall = -dot(form.b, y)
    if fall <= 0:
        return 0.0
    residual = sum((abs(value) for value in transposed(form, y)), start=fmpq(0))
    return math.inf if residual == 0 else rounded_down(fraction(fall / residual))


def dual_bound(form: ConicForm, y: Sequence[Rational]) -> Fraction | None:
    """The number -b'y, a lower bound of c'x for every solution x; None if y is no dual point of the
    form.
    """
    if len(y) != form.b.size or outside(form, y, dual=True):
        return None
    if any(p + exact_rational(q) != 0 for p, q in zip(transposed(form, y), form.c, strict=True)):
        return None
    return fraction(-dot(form.b, y))


def conic_slack(form: ConicForm, x: Sequence[Rational], *, of_ray: bool = False) -> list[Rational]:
    """b - A x for rational numbers x; -A x if x is a ray."""
    A, starts = form.A, form.A.indptr
    start = [fmpq(0)] * form.b.size if of_ray else [exact_rational(value) for value in form.b]
    return [
        start[i]
        - sum(
            (exact_rational(A.data[k]) * x[A.indices[k]] for k in range(starts[i], starts[i + 1])),
            start=fmpq(0),
        )
        for i in range(form.b.size)
    ]


def transposed(form: ConicForm, y: Sequence[Rational]) -> list[Rational]:
    """A'y for rational numbers y."""
    A, found = form.A, [fmpq(0)] * form.c.size
    for i in range(form.b.size):
        if y[i] == 0:
            continue
        for k in range(A.indptr[i], A.indptr[i + 1]):
            found[A.indices[k]] += exact_rational(A.data[k]) * y[i]
    return found


def dot(a: RealArray, x: Sequence[Rational]) -> Rational:
    """Inner product of doubles with rational numbers."""
    return sum((exact_rational(p) * q for p, q in zip(a, x, strict=True) if q != 0), start=fmpq(0))


def rounded_down(value: Fraction) -> float:
    """The largest double that is no larger than a positive rational number."""
    try:
        near = float(value)
    except OverflowError:
        return math.nextafter(math.inf, 0.0)
    return near if Fraction(near) <= value else math.nextafter(near, 0.0)
