"""Prototype poles: pole patterns for an observer or a filter with a wanted bandwidth.

The polynomials of both families have the constant coefficient 1, so that the poles' magnitudes have
the bandwidth as their geometric mean. For a sampled system map the poles by z = exp(s T).
"""

from __future__ import annotations

from math import factorial, isfinite
from numbers import Integral
from typing import Literal

import numpy as np

from workbench._core.arrays import ComplexArray
from workbench.errors import InputError
from workbench.input_checks import need_numbers

Prototype = Literal["itae", "bessel"]

ITAE = {
    1: (1.0, 1.0),
    2: (1.0, 1.4, 1.0),
    3: (1.0, 1.75, 2.15, 1.0),
    4: (1.0, 2.1, 3.4, 2.7, 1.0),
    5: (1.0, 2.8, 5.0, 5.5, 3.4, 1.0),
    6: (1.0, 3.25, 6.6, 8.6, 7.45, 3.95, 1.0),
    7: (1.0, 4.475, 10.42, 15.08, 15.54, 10.64, 4.58, 1.0),
    8: (1.0, 5.2, 12.8, 21.6, 25.75, 22.2, 13.3, 5.15, 1.0),
}
"""Polynomials of D. Graham and R. C. Lathrop, The synthesis of optimum transient response,
Trans. AIEE 72 (1953). They were found by hand on an analogue computer and only approach the least
integral of time times absolute error (ITAE) of a step: their integral is above the least one by 4 %
up to order 4, by 15 % at orders 5 and 6 and by two fifths at orders 7 and 8. They are kept because
they are what the field means by ITAE poles."""


def prototype_poles(kind: Prototype, order: int, bandwidth: float) -> ComplexArray:
    """The poles [rad/s] (order,) of a prototype with this bandwidth [rad/s], sorted by magnitude.

    "itae": nearly the least integral of t |1 - y(t)| of the step response y, orders 1 to 8.
    "bessel": the flattest group delay, roots of the reverse Bessel polynomial, orders 1 to 16;
    higher orders lose digits.

    Raises InputError for another kind or order, or a bandwidth that is not positive and finite.

    Examples
    --------
    >>> from workbench.diagnosis import prototype_poles
    >>> prototype_poles("bessel", 1, bandwidth=100.0).real.round(6).tolist()
    [-100.0]
    """
    limit = {"itae": max(ITAE), "bessel": 16}.get(str(kind))
    if limit is None:
        raise InputError(f'kind of prototype is {kind!r}; it must be "itae" or "bessel"')
    if isinstance(order, bool) or not isinstance(order, Integral) or not 1 <= order <= limit:
        raise InputError(f"order of the {kind} prototype is {order!r}; it must be 1 to {limit}")
    need_numbers(bandwidth=bandwidth)
    if not (isfinite(bandwidth) and bandwidth > 0.0):
        raise InputError(f"bandwidth is {bandwidth} rad/s; it must be positive and finite")
    roots = _bessel_roots(order) if kind == "bessel" else np.roots(ITAE[int(order)]).astype(complex)
    sorted_roots: ComplexArray = roots[np.lexsort((roots.imag, abs(roots).round(9)))]
    return bandwidth * sorted_roots


def _bessel_roots(order: int) -> ComplexArray:
    """Roots of theta_n(s) = sum_k (2n - k)! / ((n - k)! k! 2^(n - k)) s^k, scaled to product 1."""
    n = order
    rising = [
        factorial(2 * n - k) // (factorial(n - k) * factorial(k) * 2 ** (n - k))
        for k in range(n + 1)
    ]
    scale = float(rising[0]) ** (1 / n)
    # The coefficients span many decades; the substitution s = scale * r brings them near 1.
    scaled = [coefficient * scale ** (k - n) for k, coefficient in enumerate(rising)]
    roots: ComplexArray = np.roots(scaled[::-1]).astype(complex)
    return roots
