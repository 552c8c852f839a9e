"""Pairs of CasADi expressions behave as complex numbers."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.identification.parameters.complex_pair import ComplexPair

FORMULAS = {
    "polynomial": lambda a, b: 2 + 3 * a - b * a**2 + (1 - a) - 1j,
    "quotient": lambda a, b: 1 / a + b / a + a / 2.0 + np.float64(2) / a,
    "powers": lambda a, b: a**0 + a**-2 + b**0.5 + a ** np.int64(3),
    "functions": lambda a, b: np.exp(-a) + np.log(b) + np.sqrt(b) * np.conjugate(a),
    "numpy numbers": lambda a, b: np.complex128(1j) * a + np.float64(3) - a + np.square(b) - (-b),
}


@pytest.mark.parametrize("name", FORMULAS)
@settings(derandomize=True, deadline=None, max_examples=20)
@given(*[st.complex_numbers(min_magnitude=0.1, max_magnitude=5) for _ in range(2)])
def test_pairs_follow_complex_numbers(name, a, b):
    formula = FORMULAS[name]
    x = ca.SX.sym("x", 4)
    pair = formula(ComplexPair(x[0], x[1]), ComplexPair(x[2], x[3]))
    found = ca.Function("f", [x], [pair.real, pair.imag])([a.real, a.imag, b.real, b.imag])
    exact = formula(np.complex128(a), np.complex128(b))
    np.testing.assert_allclose(complex(*map(float, found)), exact, rtol=1e-9, atol=1e-9)


def test_what_a_pair_cannot_do_is_refused():
    with pytest.raises(TypeError):
        np.arctan(ComplexPair(ca.SX.sym("x")))
