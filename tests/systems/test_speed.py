"""The frequency by which time is measured, of systems with and without other poles than 0."""

import control
import numpy as np
import pytest

from workbench.systems.axis_poles import pole_may_be_at, stable_last
from workbench.systems.balancing import speed
from workbench.systems.conversion import as_system

UNITS = [1e-6, 1e-3, 1.0, 1e3, 1e6]


def turned(system, seed):
    """The system in random states, whose integrators are rounding."""
    T = np.linalg.qr(np.random.default_rng(seed).standard_normal((system.nstates,) * 2))[0]
    return T @ system.A @ T.T, T @ system.B, system.C @ T.T


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("seed", range(5))
def test_integrators_alone_are_as_fast_as_their_gain(unit, seed):
    """1e-16 rad/s were found where the eigenvalues of integrators were rounding."""
    for power in (1, 2, 3):
        system = as_system(control.tf([unit**power], [1.0] + power * [0.0]), "G")
        for parts in ((system.A, system.B, system.C), turned(system, seed)):
            assert unit / 2 <= speed(*parts) <= 2 * unit


@pytest.mark.parametrize("unit", UNITS)
def test_other_poles_decide_beside_integrators(unit):
    system = as_system(control.tf([unit**3], np.poly([0.0, 0.0, -8 * unit])), "G")
    assert 4 * unit <= speed(system.A, system.B, system.C) <= 16 * unit


def test_a_system_without_states_has_no_time():
    assert speed(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))) == 1.0


@pytest.mark.parametrize("seed", range(5))
def test_poles_at_zero_are_split_off_exactly(seed):
    rng = np.random.default_rng(seed)
    A = np.zeros((5, 5))
    A[0, 1] = A[1, 2] = 1.0
    A[3:, 3:] = np.diag([-1.0, 2.0])
    T = np.linalg.qr(rng.standard_normal((5, 5)))[0]
    Q, M, k, integrators = stable_last(T @ A @ T.T)
    assert (k, integrators) == (4, 3)
    np.testing.assert_allclose(Q @ M @ Q.T, T @ A @ T.T, atol=1e-13)
    assert not np.tril(M[:3, :3]).any() and not M[k:, :k].any()
    assert M[4, 4] == pytest.approx(-1.0)


def test_a_pole_within_rounding_is_told_in_any_units_of_states():
    A = np.array([[0.0, 1e-9], [-1e9, -1e-17]])  # an oscillator of 1 rad/s
    assert pole_may_be_at(1j, A)
    assert not pole_may_be_at(1j, A + np.diag([0.0, -1e-12]))
    assert not pole_may_be_at(0.5j, A)


@pytest.mark.parametrize("scale", [1e-30, 1.0, 1e30])
def test_powers_of_many_states_stay_within_doubles(scale):
    """A chain of fast states: its 60th power is beyond doubles in any unit but its own."""
    A = scale * (np.diag(np.full(60, -1.0)) + np.diag(np.full(59, 1e6), 1))
    B, C = np.eye(60)[:, -1:], np.eye(60)[:1]
    assert speed(A, B, C) == pytest.approx(scale, rel=0.5)


@pytest.mark.parametrize("scale", [1e-30, 1.0, 1e30])
def test_many_integrators_are_measured_by_their_gain(scale):
    A = np.diag(np.full(59, scale), 1)
    B, C = np.eye(60)[:, -1:], scale * np.eye(60)[:1]
    assert speed(A, B, C) == pytest.approx(scale, rel=0.5)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("seed", range(8))
def test_integrators_that_rounding_moves_are_no_poles(unit, seed):
    """Four of seven lay at 3e-4 rad/s, and the median was theirs."""
    rng = np.random.default_rng(seed)
    lags = -(10 ** rng.uniform(-1, 2, 3))
    slow = control.ss(control.tf([1.0, 1.0, 1.0], np.poly([*lags, 0.0, 0.0, 0.0, 0.0])))
    found = speed(slow.A * unit, slow.B * unit, slow.C) / unit
    assert found == pytest.approx(np.median(abs(lags)), rel=0.5)


@pytest.mark.parametrize("gain", [1e-150, 1e20, 1e150])
def test_a_large_gain_makes_no_integrators(gain):
    lags = as_system(control.tf([4.0, 8.0], [1.0, 6.0, 5.0]), "G")
    assert speed(lags.A, gain * lags.B, lags.C) == speed(lags.A, lags.B, lags.C)


def test_squares_of_entries_may_overflow():
    lags = as_system(control.tf([1e300], [1.0, 1e150, 1e300]), "G")
    assert speed(lags.A, lags.B, lags.C) == pytest.approx(1e150, rel=0.5)
