"""One repeated scalar alone: mu is the size of an eigenvalue, and the bound reaches it."""

import numpy as np
import pytest

from workbench.mu import MuUpperBound, upper_bound
from workbench.mu.upper.alone import is_alone
from workbench.solution import solve
from workbench.structure import Complex, Full, Real, Structure


def drawn(*shape, seed=0):
    real, imaginary = np.random.default_rng(seed).normal(size=(2, *shape))
    return real + 1j * imaginary


@pytest.mark.parametrize("n", [2, 5, 10])
@pytest.mark.parametrize("scale", [1.0, 1e-100, 1e100])
def test_a_complex_scalar_has_the_spectral_radius(n, scale):
    M = drawn(20, n, n)
    found = upper_bound(scale * M, Structure((Complex(n),))).value
    np.testing.assert_allclose(found, scale * np.abs(np.linalg.eigvals(M)).max(1), rtol=1e-7)


@pytest.mark.parametrize("n", [2, 5, 10])
def test_a_real_scalar_has_the_largest_real_eigenvalue(n):
    M = np.random.default_rng(n).normal(size=(30, n, n))
    values = np.linalg.eigvals(M)
    largest = np.where(values.imag == 0, np.abs(values), 0.0).max(1)
    found = upper_bound(M, Structure((Real(n),))).value
    assert (found >= largest * (1 - 1e-12)).all()
    some = largest > 0
    np.testing.assert_allclose(found[some], largest[some], rtol=1e-6)
    assert (found[~some] <= 1e-6 * np.abs(M[~some]).max((1, 2))).all()


HARD = {
    "one Jordan block": np.eye(4) + np.diag(np.ones(3), 1),
    "nearly one": np.eye(4) + np.diag(np.ones(3), 1) + np.diag([0, 1e-9, 2e-9, 3e-9]),
    "nilpotent": np.diag(np.ones(3), 1),
    "zero": np.zeros((4, 4)),
    "nearly real": np.array([[1, 1e-7, 0, 0], [-1e-7, 1, 0, 0], [0, 0, 0.5, 0], [0, 0, 0, 0.1]]),
    "graded": np.diag([1e-8, 1, 1e8, 1e3]) @ drawn(4, 4).real @ np.diag([1e8, 1, 1e-8, 1e-3]),
}


@pytest.mark.parametrize("name", HARD)
@pytest.mark.parametrize("kind", [Real, Complex])
def test_bounds_of_hard_matrices_are_proven_and_above_mu(name, kind):
    M = HARD[name].astype(complex)
    solution = solve(MuUpperBound(M, Structure((kind(4),))))
    assert solution.certificate.holds
    values = np.linalg.eigvals(M)
    if kind is Real:
        values = values[np.abs(values.imag) <= 1e-12 * np.abs(values)]
    assert solution.answer.value >= np.abs(values).max(initial=0.0) * (1 - 1e-3)
    assert solution.answer.value <= np.linalg.norm(M, 2) * (1 + 1e-6)


def test_only_one_repeated_scalar_is_alone():
    assert is_alone(Structure((Real(2),))) and is_alone(Structure((Complex(3),)))
    for blocks in ((Real(1),), (Full(2, 2),), (Real(2), Complex(1))):
        assert not is_alone(Structure(blocks))


@pytest.mark.parametrize("seed", range(3))
def test_nearly_dependent_eigenvectors_prove_more_than_a_path(seed):
    """A complex eigenvalue of rank one and tiny ones: no perturbation of moderate size exists."""
    rng = np.random.default_rng(seed)
    M = rng.normal(size=(20, 4, 4)) + 1j * rng.normal(size=(20, 4, 4))
    M = M[:, :, :1] @ M[:, :1, :] + 1e-9 * M
    size = np.linalg.norm(M, 2, axis=(1, 2))
    found = upper_bound(M, Structure([Real(4)])).value
    assert np.median(found / size) < 1e-5 and (found < 1e-3 * size).all()
