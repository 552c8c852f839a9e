"""Responses of many states: in Schur's coordinates where these keep all digits."""

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.systems import frequency_response as module
from workbench.systems.frequency_response import frequency_response, triangular_form

N = 80


def realised(rng, spread):
    """Lightly damped modes between 1 and `spread` rad/s in random coordinates, as [A B; C D]."""
    natural = np.geomspace(1.0, spread, N // 2)
    A = np.zeros((N, N))
    for k, omega in enumerate(natural):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = omega * np.array([[-0.01, 1.0], [-1.0, -0.01]])
    Q, _ = np.linalg.qr(rng.normal(size=(N, N)))
    B, C = rng.normal(size=(N, 2)), rng.normal(size=(3, N))
    return np.block([[Q @ A @ Q.T, B], [C, rng.normal(size=(3, 2))]])


def by_elimination(M, s):
    A, B, C, D = M[:N, :N], M[:N, N:], M[N:, :N], M[N:, N:]
    return np.array([D + C @ np.linalg.solve(one * np.eye(N) - A, B) for one in s])


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_substitution_and_elimination_agree(scale):
    M = realised(np.random.default_rng(0), 1e3)
    M[:N] *= scale
    s = 1j * scale * np.geomspace(0.1, 1e4, 50)
    found, expected = frequency_response(M, N, s), by_elimination(M, s)
    assert triangular_form(M[:N, :N], M[:N, N:], M[N:, :N]) is not None
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()
    assert np.abs(found / expected - 1).max() < 1e-7


def test_poles_far_apart_are_left_to_elimination():
    M = realised(np.random.default_rng(1), 1e7)
    assert triangular_form(M[:N, :N], M[:N, N:], M[N:, :N]) is None
    s = 1j * np.geomspace(0.1, 1e8, 50)
    assert np.abs(frequency_response(M, N, s) / by_elimination(M, s) - 1).max() < 1e-5


def test_a_pole_among_the_points_is_named():
    M = np.zeros((N + 1, N + 1))
    M[:N, :N] = np.diag(-np.arange(1.0, N + 1.0))
    M[:N, N:], M[N:, :N] = 1.0, 1.0
    with pytest.raises(InputError, match="leave that frequency out"):
        frequency_response(M, N, [1.0, 2.0, -3.0, 4.0, 5.0])


def test_another_system_of_the_same_shape_is_no_kept_one():
    rng = np.random.default_rng(2)
    s = 1j * np.geomspace(0.1, 1e4, 10)
    module._kept_form.cache_clear()
    for _ in range(3):
        M = realised(rng, 1e3)
        for _ in range(2):
            assert np.allclose(frequency_response(M, N, s), by_elimination(M, s), rtol=1e-7)
    assert module._kept_form.cache_info().hits == 3
