"""Responses from eigenvectors against elimination, also where eigenvectors lose digits."""

import control
import numpy as np
import pytest

from workbench.certify.modes.modal_response import FEWEST_DECOMPOSED, modal_response
from workbench.certify.stable_system import stable_system


def direct(A, B, C, s):
    """C (s I - A)^-1 B by elimination."""
    return C @ np.linalg.solve(s[:, None, None] * np.eye(len(A)) - A, B + 0j)


def lightly_damped(rng, n, skewed):
    """Modes in skewed coordinates."""
    A = np.zeros((n, n))
    for k, omega in enumerate(np.geomspace(1.0, 1e3, n // 2)):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = omega * np.array([[-0.01, 1.0], [-1.0, -0.01]])
    T = np.eye(n) + skewed * np.triu(rng.normal(size=(n, n)), 1)
    return np.linalg.solve(T, A @ T), rng.normal(size=(n, 2)), rng.normal(size=(3, n))


@pytest.mark.parametrize("skewed", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("of_largest", [False, True])
def test_it_is_the_response_by_elimination(skewed, of_largest):
    A, B, C = lightly_damped(np.random.default_rng(1), 24, skewed)
    s = 1j * np.geomspace(0.1, 1e4, 300)
    found = modal_response(A, B, C).at(s, 1e-9, of_largest=of_largest)
    true = direct(A, B, C, s)
    size = np.abs(true).max(axis=(1, 2))
    scale = size.max() if of_largest else size
    rounding = 1e-15 * np.linalg.cond(np.linalg.eig(A)[1])  # of the elimination
    assert (np.abs(found - true).max(axis=(1, 2)) <= (1e-8 + 100 * rounding) * scale).all()


def test_small_responses_keep_their_digits_where_terms_cancel():
    """C B = 0, so that the response falls as 1 / s^2 and the terms as 1 / s."""
    A, B, C = lightly_damped(np.random.default_rng(2), 20, 0.1)
    B = B - C.T @ np.linalg.solve(C @ C.T, C @ B)
    s = 1j * np.geomspace(1e3, 1e9, 50)
    found, true = modal_response(A, B, C).at(s, 1e-9), direct(A, B, C, s)
    away, size = (np.abs(part).max(axis=(1, 2))[:30] for part in (found - true, true))
    assert (away <= 1e-7 * size).all() and size[-1] < 1e-6 * size[0]


def test_dependent_eigenvectors_and_few_states_have_none():
    """A chain of equal lags, whose eigenvectors in doubles would give any response at all."""
    n = 20
    chain = -np.eye(n) + np.diag(np.ones(n - 1), -1)
    assert modal_response(chain, np.eye(n, 1), np.eye(1, n, n - 1)) is None
    few = np.eye(FEWEST_DECOMPOSED - 1)
    assert modal_response(-few, few, few) is None


def test_small_entries_count_for_mu_and_are_kept_where_no_error_is_allowed():
    """Channels of sizes 1e6 and 1e-6: their product is what mu sees."""
    A, B, C = lightly_damped(np.random.default_rng(3), 24, 0.3)
    B, C = B * [1e6, 1e-6], C[:2] * np.array([[1e6], [1e-6]])
    system = stable_system(control.ss(A, B, C, np.zeros((2, 2))))
    omega = np.geomspace(0.1, 1e4, 50)
    true = direct(A, B, C, 1j * omega)
    np.testing.assert_allclose(system.response(omega), true, rtol=1e-8)
    rough = np.abs(system.response(omega, 1e-9) - true).max()
    assert rough <= 1e-8 * np.abs(true).max()
