"""Reduction of systems with poles on the axis: they are kept exactly, or the order is refused."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.synthesis import approximated

METHODS = ("balanced", "matchdc", "hankel")
SEEDS = range(40)


def entries(system):
    return max(abs(part).max(initial=0.0) for part in (system.A, system.B, system.C, system.D))


@pytest.mark.parametrize("method", METHODS)
def test_a_double_integrator_keeps_both(method):
    """68 of 100 of (s + z) / s^2 were answered with one state and gains of 1e7 to 1e15."""
    for seed in SEEDS:
        (z,) = 10 ** np.random.default_rng(seed).uniform(-2, 2, 1)
        K = control.tf([1.0, z], [1.0, 0.0, 0.0])
        for given in (K, control.ss(K)):
            with pytest.raises(InputError, match="keeps the 2 poles that are not stable"):
                approximated(given, 1, method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_a_lag_beside_a_double_integrator_goes(method, unit):
    for seed in SEEDS:
        z, p = 10 ** np.random.default_rng(seed).uniform(-2, 2, 2) * unit
        found = approximated(control.tf([1.0, z], [1.0, p, 0.0, 0.0]), 2, method)
        assert found.poles().tolist() == [0.0, 0.0]
        slow = 1e-3j * min(z, p)
        assert found(slow) == pytest.approx(z / p / slow**2, rel=2e-2)


@pytest.mark.parametrize("method", METHODS)
def test_a_pid_keeps_its_integrator(method):
    """Each had its integrator at 1e-19 to 1e-15, on either side."""
    for seed in SEEDS:
        P, slow, D, lag = 10 ** np.random.default_rng(seed).uniform(-2, 2, 4)
        K = control.tf([P], [1]) + control.tf([slow], [1, 0]) + control.tf([D, 0], [lag, 1])
        for given in (K, control.ss(K)):
            found = approximated(given, 1, method)
            assert found.poles().tolist() == [0.0]
            assert (found.C @ found.B).item() == pytest.approx(slow, rel=1e-9)
            assert entries(found) < 1e6


@pytest.mark.parametrize("method", METHODS)
def test_a_repeated_undamped_pole_in_random_states(method):
    """Rounding moves such poles by 1e-8: one counted as stable, with a gain of 1e8."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        turn = 10 ** rng.uniform(-1, 1) * np.array([[0.0, 1.0], [-1.0, 0.0]])
        A = np.zeros((6, 6))
        A[:4, :4] = np.kron(np.eye(2), turn) + np.kron([[0.0, 1.0], [0.0, 0.0]], np.eye(2))
        A[4:, 4:] = np.diag(-(10 ** rng.uniform(-1, 1, 2)))
        T = rng.standard_normal((6, 6))
        B, C = rng.standard_normal((6, 1)), rng.standard_normal((1, 6))
        K = control.ss(T @ A @ np.linalg.inv(T), B, C, 0.0)
        with pytest.raises(InputError, match="keeps the 4 poles"):
            approximated(K, 3, method)
        found = approximated(K, 4, method)
        assert entries(found) < 1e6
        far = 1e3j * abs(turn).max()
        assert found(far) - found.D[0, 0] == pytest.approx(
            K(far) - 0.0, abs=1e-1 * abs(K(far)) + 1.0
        )
