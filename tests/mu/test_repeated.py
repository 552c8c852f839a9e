"""Paths of repeated scalars, where rounding hides the flat directions of Newton's matrix."""

import numpy as np
import pytest

from workbench.mu.upper.linear_algebra import factor_normal, solve_normal
from workbench.mu.upper.multipliers import path_multipliers
from workbench.mu.upper.pattern import pattern_of
from workbench.structure import Complex, Full, Real, Structure

STRUCTURES = {
    "ten real and full": Structure([Real(10), Full(2, 2)]),
    "two real": Structure([Real(5), Real(4)]),
    "real, complex, full": Structure([Real(6), Complex(4), Full(2, 2)]),
    "two complex": Structure([Complex(8), Complex(2)]),
}
ACCURACY = 2e-8
"""What a path is asked for by default, of the square of the bound."""


def drawn(structure, kind, count, seed=3):
    rng, c, r = np.random.default_rng(seed), structure.columns, structure.rows
    real, imaginary = rng.normal(size=(2, count, c, r))
    M = real + 1j * imaginary
    return {
        "complex": M,
        "real": real + 0j,
        "nearly real": real + 1e-3j * imaginary,
        "nearly of rank one": M[:, :, :1] @ M[:, :1, :] + 0.01 * real,
        "of rank two": M[:, :, :2] @ M[:, :2, :],
    }[kind]


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize(
    "kind", ["complex", "real", "nearly real", "nearly of rank one", "of rank two"]
)
def test_no_path_stalls(name, kind):
    structure = STRUCTURES[name]
    M = drawn(structure, kind, 10)
    *_, gaps, iterations = path_multipliers(structure, pattern_of(structure), ACCURACY, 0.0, M)
    assert (gaps <= ACCURACY).all()
    assert iterations.mean() <= 25


@pytest.mark.parametrize("seed", range(4))
def test_flat_directions_that_rounding_hides_are_held_back(seed):
    """In H = k b b^T + F, rounding of the first term is as large as the least eigenvalues of F."""
    rng, m = np.random.default_rng(seed), 40
    Q = np.linalg.qr(rng.normal(size=(m, m)))[0]
    root = Q[:, 1:] * np.concatenate([np.ones(19), np.full(20, 1e-3)])
    F = root @ root.T
    exact = Q[:, 1:] @ rng.normal(size=39)
    R, x = np.triu(1e12 * np.outer(Q[:, 0], Q[:, 0]) + F), np.zeros(m)
    factor_normal(R)
    solve_normal(R, F @ exact, x)
    assert np.linalg.norm(x) <= 1.5 * np.linalg.norm(exact)


@pytest.mark.parametrize("lost", [0, 3, 6])
def test_an_unknown_without_influence_stays_as_it_is(lost):
    rng = np.random.default_rng(1)
    A = rng.normal(size=(9, 7))
    A[:, lost] = 0.0
    H, b, x = A.T @ A, rng.normal(size=7), np.zeros(7)
    R = np.triu(H)
    factor_normal(R)
    solve_normal(R, b, x)
    rest = np.delete(np.arange(7), lost)
    assert abs(x[lost]) < 1e-50
    np.testing.assert_allclose(H[np.ix_(rest, rest)] @ x[rest], b[rest], atol=1e-10)


def test_factors_of_regular_matrices_are_exact():
    for m in (1, 2, 3, 4, 5, 8, 13, 50):
        A = np.random.default_rng(m).normal(size=(m, m))
        H = A @ A.T + np.eye(m)
        R = np.triu(H)
        factor_normal(R)
        R = np.triu(R)
        np.testing.assert_allclose(R.T @ R, H, atol=1e-13 * np.abs(H).max())
