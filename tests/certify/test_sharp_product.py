"""Products of real matrices whose terms cancel, against exact arithmetic of rationals."""

from fractions import Fraction

import numpy as np
import pytest

from workbench.certify.rounding import exact, residual_product, sharp_product


def holds(found, X, Y):
    """Whether every exact entry of X Y is within its radius."""
    for i, row in enumerate(X.tolist()):
        for j, column in enumerate(Y.T.tolist()):
            true = sum(Fraction(x) * Fraction(y) for x, y in zip(row, column, strict=True))
            if abs(Fraction(found.mid[i, j]) - true) > Fraction(found.rad[i, j]):
                return False
    return True


@pytest.mark.parametrize("inner", [1, 2, 7, 64])
@pytest.mark.parametrize("decades", [0, 8])
def test_the_exact_product_is_enclosed_to_the_last_bit(inner, decades):
    rng = np.random.default_rng(inner)
    X, Y = (rng.normal(size=s) * 10.0 ** rng.uniform(-decades, decades, s)
            for s in ((5, inner), (inner, 4)))  # fmt: skip
    found = sharp_product(X, Y)
    assert holds(found, X, Y)
    size = np.abs(X) @ np.abs(Y)
    assert (found.rad <= 3e-16 * np.abs(found.mid) + 1e-24 * 10.0 ** (2 * decades) * size).all()


def test_what_cancels_keeps_its_digits():
    rng = np.random.default_rng(1)
    A, B = rng.normal(size=(30, 30)), rng.normal(size=(30, 6))
    X = np.linalg.solve(A, B)
    left, right = np.hstack([A, np.eye(30)]), np.vstack([X, -B])
    found = sharp_product(left, right)
    assert np.abs(found.mid).max() < 1e-12  # a residual
    assert holds(found, left, right)
    assert (found.rad < 1e-6 * np.abs(found.mid).max()).all()


def test_zeros_and_the_smallest_numbers():
    assert not sharp_product(np.zeros((3, 4)), np.ones((4, 2))).mid.any()
    X, Y = np.full((2, 3), 1e-300), np.full((3, 2), 1e-20)
    assert holds(sharp_product(X, Y), X, Y)
    X, Y = np.array([[1e-200, 1e200]]), np.array([[1e200], [1e-200]])
    assert holds(sharp_product(X, Y), X, Y)


@pytest.mark.parametrize("inner", [1, 2, 7, 64])
@pytest.mark.parametrize("decades", [0, 8])
def test_products_for_residuals_are_enclosed(inner, decades):
    rng = np.random.default_rng(inner)
    X, Y = (rng.normal(size=s) * 10.0 ** rng.uniform(-decades, decades, s)
            for s in ((9, inner), (inner, 6)))  # fmt: skip
    found = residual_product(X, Y)
    assert holds(found, X, Y)
    unit = np.abs(X).max(axis=1, keepdims=True) * np.abs(Y).max(axis=0) * 10.0**decades
    assert (found.rad <= 3e-16 * np.abs(found.mid) + 1e-20 * inner**2 * unit).all()


@pytest.mark.parametrize("size", [1, 7, 30])
def test_residuals_keep_digits_that_products_of_doubles_lose(size):
    rng = np.random.default_rng(size)
    A, B = rng.normal(size=(size, size)), rng.normal(size=(size, 6))
    X = np.linalg.solve(A, B)
    left, right = np.hstack([A, np.eye(size)]), np.vstack([X, -B])
    found = residual_product(left, right)
    assert holds(found, left, right)
    plain = exact(left) @ exact(right)
    assert found.rad.max() < 2.0**-16 * plain.rad.max()
