"""Eigenvectors of many digits, and modal coordinates from them."""

import flint
import numpy as np
import pytest

from workbench.certify.modes import eigenpairs as module
from workbench.certify.modes.eigenpairs import eigenpairs
from workbench.certify.modes.modal_form import _in_balls, _in_doubles, _modes, real_balls

BITS = 128
PAIR = np.array([[-0.1, 1.0], [-1.0, -0.1]])


def turned(A, seed=0):
    """A in random orthogonal coordinates, with states of different units."""
    rng = np.random.default_rng(seed)
    Q = np.linalg.qr(rng.normal(size=A.shape))[0]
    units = 10.0 ** rng.integers(-3, 4, len(A))
    return Q @ A @ Q.T * units[:, None] / units


def residual(A, vectors):
    """Largest part of A v outside the direction of v, over columns with entries of order one."""
    n, worst = len(A), 0.0
    with flint.ctx.workprec(2 * BITS):
        image = flint.acb_mat(real_balls(A)) * vectors
        for j in range(n):
            v = [vectors[i, j] for i in range(n)]
            k = max(range(n), key=lambda i: float(abs(v[i]).mid()))
            value = image[k, j] / v[k]
            off = max(float(abs(image[i, j] - value * v[i]).mid()) for i in range(n))
            worst = max(worst, off / float(abs(v[k]).mid()))
    return worst


@pytest.mark.parametrize("n", [1, 2, 7, 30])
def test_newtons_method_adds_digits(n):
    A = turned(np.random.default_rng(n).normal(size=(n, n)), n)
    with flint.ctx.workprec(BITS):
        found = module._refined(real_balls(A), BITS)
    assert found is not None
    assert residual(A, found[1]) < 1e-25 * np.abs(A).max()


def test_values_are_those_of_the_qr_iteration():
    A = turned(np.kron(np.diag([1.0, 30.0, 30.5]), PAIR))
    with flint.ctx.workprec(BITS):
        values = eigenpairs(real_balls(A), BITS)[0]
        exact = flint.acb_mat(real_balls(A)).eig(algorithm="approx")
    for one in map(complex, exact):
        assert min(abs(one - other) for other in values) < 1e-9 * abs(one)


def test_a_long_chain_is_left_to_the_qr_iteration():
    A = turned(-np.eye(6) + np.eye(6, k=1))
    with flint.ctx.workprec(BITS):
        assert module._refined(real_balls(A), BITS) is None
        values, _ = eigenpairs(real_balls(A), BITS)
    assert np.allclose(values, -1.0, atol=1e-2)


def test_what_is_not_finite_is_not_refined():
    with flint.ctx.workprec(BITS):
        unknown = flint.arb_mat(2, 2, [1, 2, 3, flint.arb("nan")])
        assert module._refined(unknown, BITS) is None


@pytest.mark.parametrize(
    "A",
    [
        np.diag([-1.0, -2.0, -1000.0]),
        np.kron(np.eye(2), PAIR),
        np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -3.0]]),
    ],
)
def test_both_ways_to_modal_coordinates_agree(A):
    A = turned(A)
    B = np.random.default_rng(1).normal(size=(len(A), 2))
    with flint.ctx.workprec(BITS):
        balls = real_balls(A), real_balls(B)
        T, mode = _modes(balls[0], BITS)
        quick, slow = _in_doubles(T, *balls, mode), _in_balls(T, *balls)
    assert quick is not None
    for one, other in zip(quick, slow, strict=True):
        assert (np.abs(one.mid - other.mid) <= one.rad + other.rad).all()
        largest = np.abs(other.mid).max(axis=1, keepdims=True)
        assert (one.rad <= 2e-15 * largest).all()


def test_coordinates_that_are_nearly_dependent_are_left_to_balls():
    T = np.array([[1.0, 1.0], [1.0, 1.0 + 1e-15]])
    with flint.ctx.workprec(BITS):
        balls = [real_balls(part) for part in (T, np.diag([-1.0, -2.0]), np.ones((2, 1)))]
        assert _in_doubles(*balls, np.array([0, 1])) is None
