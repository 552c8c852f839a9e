"""Exact rational functions against python-control."""

import control
import numpy as np
import pytest
from flint import fmpq, fmpq_poly

from workbench.certify.known_plants.exact_function import (
    exact_function,
    exact_square,
    monic,
    products,
)
from workbench.errors import InputError
from workbench.fitting.rational import Rational

FIRST = Rational([-2.0, -1 - 3j, -1 + 3j], [-1.0, -4.0, -0.1 - 5j, -0.1 + 5j], 7.0)
SECOND = Rational([], [-3.0], -0.5)
OMEGA = np.geomspace(1e-2, 1e3, 60)


def transfer(function):
    return control.zpk(function.zeros, function.poles, function.gain)


@pytest.mark.parametrize("function", [FIRST, SECOND])
def test_responses(function):
    found = exact_function(function).response(OMEGA)
    np.testing.assert_allclose(found, transfer(function)(1j * OMEGA), rtol=1e-9)


def test_differences_and_quotients():
    one, other = exact_function(FIRST), exact_function(SECOND)
    a, b = (transfer(each)(1j * OMEGA) for each in (FIRST, SECOND))
    np.testing.assert_allclose((one - other).response(OMEGA), a - b, rtol=1e-9)
    np.testing.assert_allclose((one / other).response(OMEGA), a / b, rtol=1e-9)
    assert (one.relative_degree, (one / other).relative_degree) == (1, 0)
    assert (one / one).numerator.degree() == 0
    with pytest.raises(InputError, match="zero function"):
        one / (one - one)


def test_squares_are_polynomials_of_the_squared_frequency():
    square = exact_square(monic([-2.0, -1 - 3j, -1 + 3j]))
    values = [float(square(int(w) ** 2).p) for w in (1, 2, 3)]
    truth = [abs((1j * w + 2) * ((1j * w + 1) ** 2 + 9)) ** 2 for w in (1, 2, 3)]
    np.testing.assert_allclose(values, truth, rtol=1e-12)


def test_products_are_those_of_complex_values():
    """Re and Im of f g* at s = 3 j, and of all powers up to the fifth."""
    f, g = fmpq_poly([1, -2, 3, 5, 0, 7]), fmpq_poly([-4, 1, 2, -1, 6, 2])
    s = 3j
    value = (
        complex(*(float(part) for part in _parts(f, s)))
        * complex(*(float(part) for part in _parts(g, s))).conjugate()
    )
    re, im = products(f, g)
    assert float(re(fmpq(9))) == value.real
    assert 3.0 * float(im(fmpq(9))) == value.imag
    assert float(exact_square(f)(fmpq(9))) == sum(float(part) ** 2 for part in _parts(f, s))


def _parts(f, s):
    value = sum(int(c) * s**k for k, c in enumerate(f.coeffs()))
    return value.real, value.imag
