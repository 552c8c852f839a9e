"""Discs by real products against eigenvalues in balls, and against those by complex products."""

from itertools import product

import flint
import numpy as np
import pytest

from workbench.certify.eigenvalues import pencil_discs, pole_discs, real_discs, static_discs
from workbench.certify.modes.real_eigenvalues import FEWEST_REAL, _in_pairs, real_pencil
from workbench.certify.rounding import Enclosure, exact


def matrix(seed, n):
    """A matrix with real eigenvalues and pairs of complex ones."""
    rng = np.random.default_rng(seed)
    A = np.diag(-np.geomspace(1.0, 1e3, n))
    for k in range(0, n - 4, 2):
        A[k, k + 1], A[k + 1, k] = 30 * A[k, k], -30 * A[k, k]
    T = np.eye(n) + 0.3 * rng.normal(size=(n, n)) / np.sqrt(n)
    return np.linalg.solve(T, A @ T)


def exactly(A):
    """Eigenvalues of the matrix of doubles to many digits."""
    with flint.ctx.workprec(256):
        found = flint.acb_mat(A.tolist()).eig(multiple=True)
        return np.array([complex(value.mid()) for value in found])


@pytest.mark.cases(1)
@pytest.mark.parametrize("n", [FEWEST_REAL, 53])
def test_discs_hold_every_eigenvalue(n):
    A = matrix(n, n)
    discs = pole_discs(exact(A))
    away = np.abs(exactly(A)[:, None] - discs.centre)
    nearest = away.argmin(axis=1)
    assert len(set(nearest)) == n  # each has its own
    assert (away.min(axis=1) <= discs.radius[nearest]).all()
    assert (discs.radius < 1e-8 * np.abs(discs.centre)).all()


@pytest.mark.parametrize("omega", [0.0, 7.0])
def test_blocks_are_eliminated_as_by_complex_products(omega):
    n, rng = FEWEST_REAL, np.random.default_rng(2)
    A, B, C = matrix(2, n), rng.normal(size=(n, 3)), rng.normal(size=(3, n))
    parts = [exact(part) for part in (A, B, C, np.eye(3) + 0.1 * rng.normal(size=(3, 3)))]
    ours = pencil_discs(*real_pencil(*parts, omega))
    turned = [Enclosure(-1j * part.mid, part.rad) for part in parts[:2]]
    turned[0] = turned[0] - exact(omega * np.eye(n))
    theirs = static_discs(*turned, *parts[2:])
    away = np.abs(ours.centre[:, None] - theirs.centre)
    assert (away.min(axis=1) <= ours.radius + theirs.radius[away.argmin(axis=1)]).all()
    assert ours.radius.max() < 4 * theirs.radius.max()


def test_errors_of_entries_widen_the_discs():
    A, rng = matrix(5, 45), np.random.default_rng(5)
    discs = pole_discs(Enclosure(A, np.full(A.shape, 1e-6)))
    for _ in range(5):
        member = A + 1e-6 * (1 - 1e-9) * rng.choice([-1.0, 1.0], A.shape)
        away = np.abs(np.linalg.eigvals(member)[:, None] - discs.centre)
        assert (away <= discs.radius).any(axis=1).all()
    assert (discs.radius > 1e-7).all()


def test_a_pair_of_rows_and_columns_holds_what_every_choice_of_errors_makes():
    """K^-1 M K of M = 0 with errors of 1: some choice of signs makes each entry sqrt(2)."""
    K = np.array([[1, 1], [1j, -1j]])
    found = _in_pairs(Enclosure(np.zeros((3, 3)), np.ones((3, 3))), np.array([0]))
    whole = np.eye(3, dtype=complex)
    whole[:2, :2] = K
    for signs in product((-1.0, 1.0), repeat=9):
        member = np.linalg.solve(whole, np.reshape(signs, (3, 3)) @ whole)
        assert (np.abs(member - found.mid) <= found.rad).all()


def test_what_is_not_real_or_has_no_eigenvectors_is_left_to_complex_products():
    n = FEWEST_REAL
    empty = [exact(np.zeros(shape)) for shape in ((n, 0), (0, n), (0, 0))]
    assert real_pencil(exact(matrix(1, n) + 1j), *empty) is None
    assert real_pencil(exact(matrix(1, n - 1)), *empty) is None
    chain = exact(-np.eye(n) + np.diag(np.ones(n - 1), -1))
    found = real_discs(chain, *empty)  # an eigenvalue n times
    assert found.doubtful() or np.isinf(found.radius).any() or found.radius.max() > 1e-3


def test_of_few_rows_several_doubtful_discs_say_more_than_one_that_is_everything():
    """Two pairs of equal eigenvalues, each with one vector: one real, one at 1000."""
    chain = np.array([[0.0, 1.0], [0.0, 0.0]])
    A = np.kron(np.eye(2), chain) + np.diag([0.0, 0.0, 1e3, 1e3])
    turned = np.kron(np.array([[0.0, 1.0], [-1.0, 0.0]]), A)  # on the imaginary axis
    none = (exact(np.zeros(shape)) for shape in ((8, 0), (0, 8), (0, 0)))
    found = real_discs(exact(turned), *none)
    assert found.doubtful() >= 2
    assert np.isfinite(found.radius).all()
