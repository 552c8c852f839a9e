"""Reduction of systems with poles on the axis: they are kept exactly, or the order is refused."""

from dataclasses import replace

import control
import numpy as np
import pytest
from lanes import thinned

from workbench.errors import InputError
from workbench.synthesis import approximate

METHODS = ("balanced", "matchdc", "hankel")
SEEDS = range(40)


def entries(system):
    return max(abs(part).max(initial=0.0) for part in (system.A, system.B, system.C, system.D))


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", METHODS)
def test_a_double_integrator_keeps_both(method):
    """68 of 100 of (s + z) / s^2 were answered with one state and gains of 1e7 to 1e15."""
    for seed in SEEDS:
        (z,) = 10 ** np.random.default_rng(seed).uniform(-2, 2, 1)
        K = control.tf([1.0, z], [1.0, 0.0, 0.0])
        for given in (K, control.ss(K)):
            with pytest.raises(InputError, match="keeps the 2 poles that are not stable"):
                approximate(given, 1, method=method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_a_lag_beside_a_double_integrator_goes(method, unit):
    for seed in SEEDS:
        z, p = 10 ** np.random.default_rng(seed).uniform(-2, 2, 2) * unit
        found = approximate(control.tf([1.0, z], [1.0, p, 0.0, 0.0]), 2, method=method)
        assert found.poles().tolist() == [0.0, 0.0]
        slow = 1e-3j * min(z, p)
        assert found(slow) == pytest.approx(z / p / slow**2, rel=2e-2)


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", METHODS)
def test_a_pid_keeps_its_integrator(method):
    """Each had its integrator at 1e-19 to 1e-15, on either side."""
    for seed in SEEDS:
        P, slow, D, lag = 10 ** np.random.default_rng(seed).uniform(-2, 2, 4)
        K = control.tf([P], [1]) + control.tf([slow], [1, 0]) + control.tf([D, 0], [lag, 1])
        for given in (K, control.ss(K)):
            found = approximate(given, 1, method=method)
            assert found.poles().tolist() == [0.0]
            assert (found.C @ found.B).item() == pytest.approx(slow, rel=1e-9)
            assert entries(found) < 1e6


@pytest.mark.cases(1)
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
            approximate(K, 3, method=method)
        found = approximate(K, 4, method=method)
        assert entries(found) < 1e6
        far = 1e3j * abs(turn).max()
        assert found(far) - found.D[0, 0] == pytest.approx(
            K(far) - 0.0, abs=1e-1 * abs(K(far)) + 1.0
        )


def pid_with_integrators(seed):
    """A PID times integrators and lags, and the number of poles at 0."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(0, 4))
    den = np.array([1.0] + count * [0.0])
    for _ in range(rng.integers(1, 5)):
        den = np.polymul(den, [10 ** rng.uniform(-1.5, 1.5), 1.0])
    P, slow, D = 10 ** rng.uniform(-1, 1, 3)
    lag = 10 ** rng.uniform(-3, 0)
    K = control.tf([P], [1]) + control.tf([slow], [1, 0]) + control.tf([D, 0], [lag, 1])
    return K * control.tf([1.0], den), count + 1


def formed(seed):
    """The same as states: those of python-control, random ones, or sampled."""
    K, count = pid_with_integrators(seed)
    K, rng = control.ss(K), np.random.default_rng(seed)
    if seed % 3 == 1:
        T = rng.standard_normal((K.nstates, K.nstates))
        K = control.ss(T @ K.A @ np.linalg.inv(T), T @ K.B, K.C @ np.linalg.inv(T), K.D)
    return (K.sample(0.1) if seed % 3 == 2 else K), count


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("group", thinned(range(15), 5))
def test_integrators_made_of_rounding_are_kept_exactly(method, group):
    """Four at 3e-4 rad/s beside lags of 0.1 rad/s; two raised a LinAlgError."""
    for seed in range(6 * group, 6 * group + 6):
        K, count = formed(seed)
        found = approximate(K, count + 1, method=method)
        assert (found.poles() == (1.0 if K.dt else 0.0)).sum() == count, seed
        assert np.isfinite(found.error) and found.holds, (seed, found.certificate.failures)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("others", [[], [-1.0], [1.0], [1.0, 1.0]])
def test_poles_at_minus_one_are_kept_exactly(method, others):
    G = control.tf([1.0, 0.2], np.poly([-1.0, *others, 0.3, 0.5]), 0.1)
    for given in (G, control.ss(G)):
        small = approximate(given, 2 + len(others), method=method)
        kept = sorted(pole.real for pole in small.poles() if abs(abs(pole) - 1.0) < 1e-6)
        assert kept == sorted([-1.0, *others])
        assert 0.0 < small.error < 10.0 and small.holds


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "given",
    [
        control.tf([1.0], np.polymul([1.0, 0.0, 2.0, 0.0, 1.0], [1.0, 3.0, 2.0])),
        control.ss(control.tf([1.0], np.polymul([1.0, 0.0, 1.0], [1.0, 3.0, 2.0]))).sample(0.1),
        control.tf([1.0], np.polymul([1.0, -1.0, 1.0], [1.0, 0.3, 0.02]), 0.1),
    ],
    ids=["repeated pair", "sampled pair", "sampled pair of coefficients"],
)
def test_the_error_beside_undamped_pairs_is_proven(method, given):
    """Rounding moves the pair a little; both systems are given the same one."""
    kept = int((abs(abs(given.poles()) - 1.0) < 1e-6).sum())
    small = approximate(given, kept + 1, method=method)
    assert np.isfinite(small.error) and small.holds, small.certificate.failures


@pytest.mark.cases(2)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("unit", [1e-150, 1e150])
def test_far_units_of_time_and_of_signals(method, unit):
    """A gain of 1e150 was told to have two poles that are not stable."""
    lags = control.tf([1.0], [1.0, unit]) + control.tf([3.0], [1.0, 5.0 * unit])
    slow = control.tf([1.0], [1.0, 1.0]) + control.tf([3.0], [1.0, 5.0])
    plain = approximate(slow, 1, method=method).error
    for given, size in ((unit * lags, plain), (unit * slow, unit * plain)):
        small = approximate(given, 1, method=method)
        assert small.error == pytest.approx(size, rel=1e-4) and small.holds


def test_integrators_beside_fast_and_slow_poles():
    """With time measured by the fastest pole no error was proven, or a LinAlgError raised."""
    for slow in (0.015, 0.1):
        den = np.polymul(np.poly([-714.0, -8.4, -1.1, -0.23, -slow]), [1.0, 0.0, 0.0, 0.0, 0.0])
        small = approximate(control.tf([1.0, 1.0], den), 6, method="balanced")
        assert np.isfinite(small.error) and small.holds


def test_another_reference_is_noticed():
    """Exact poles with another gain: the change is proven to be large, and responses tell it."""
    K, count = formed(1)
    small = approximate(K, count + 1, method="balanced")
    checker = small._checked_by[0]
    one = checker.references[0]
    assert one.coordinates is not None and one.change(K) < 1e-12
    wrong = replace(one, system=control.ss(one.system.A, 2.0 * one.system.B, one.system.C, 0.0))
    assert wrong.change(K) > 1e-4
    checker.references[:] = [wrong]
    assert "kept poles" in " ".join(str(one) for one in small.certificate.failures)
    assert not {one.name: one for one in checker.second_opinion(small)}["given"].holds
