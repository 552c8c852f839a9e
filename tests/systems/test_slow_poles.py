"""Poles on the axis up to rounding, and slow poles beside fast ones, which are not on it."""

import control
import numpy as np
import pytest

from workbench.synthesis import approximate
from workbench.systems.axis_poles import integrators_first, stable_last
from workbench.systems.balancing import axis_rounding
from workbench.systems.hidden_states import visible_matrices
from workbench.systems.realisation import in_words

FAST = [-1.0, -1e8, -2e8]


def chained(poles):
    """A realisation with these poles, in which each state drives those before it."""
    n = len(poles)
    A = np.diag(poles) + np.triu(np.ones((n, n)), 1)
    return control.ss(A, np.ones((n, 1)), np.ones((1, n)), 0.0)


def in_units(G, units):
    return control.ss(G.A * units[:, None] / units, G.B * units[:, None], G.C / units, G.D)


def turned(G, seed):
    T = np.linalg.qr(np.random.default_rng(seed).standard_normal((G.nstates,) * 2))[0]
    return control.ss(T @ G.A @ T.T, T @ G.B, G.C @ T.T, G.D)


@pytest.mark.parametrize("method", ["balanced", "matchdc", "hankel"])
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("state", [0, 1, 3])
def test_a_slow_pole_is_no_integrator_in_any_units_of_states(method, unit, state):
    """A pole at -1e-6 became an integrator, with an error said to be 5e-13."""
    units = np.ones(4)
    units[state] = unit
    G = in_units(chained([-1e-6, *FAST]), units)
    small = approximate(G, 2, method=method)
    assert (small.poles().real < 0.0).all() and small.holds
    assert small(0.0) == pytest.approx(chained([-1e-6, *FAST])(0.0), rel=1e-6)


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_integrators_beside_a_slow_pole_are_told_apart(count, unit):
    """Both counted as integrators."""
    G = in_units(chained([*count * [0.0], -1e-6, *FAST]), np.array([*count * [1.0], unit, 1, 1, 1]))
    small = approximate(G, count + 1, method="balanced")
    assert sorted(small.poles().real)[1:] == count * [0.0] and small.holds
    assert small.poles().real.min() == pytest.approx(-1e-6)
    said = "an integrator" if count == 1 else "2 integrators"
    assert f"with {said}, stable otherwise" in in_words(G)


@pytest.mark.parametrize("seed", range(5))
def test_what_rounding_of_full_states_hides_is_an_integrator(seed):
    for G in (chained([0.0, *FAST]), chained([1e-10, *FAST])):
        A = turned(G, seed).A
        assert stable_last(A)[2:] == (1, 1)


def test_an_entry_of_the_size_of_rounding_is_an_integrator():
    """As a Schur form of rounded numbers has it."""
    A = chained([1e-9, *FAST]).A
    assert stable_last(A)[2:] == (1, 1)


@pytest.mark.parametrize("real", [-1e-6, 1e-6])
def test_a_slowly_damped_pair_is_not_undamped(real):
    """Beside a pole of 1e8 rad/s it counted as undamped, and was kept so."""
    A = np.zeros((4, 4))
    A[:2, :2] = [[real, 100.0], [-100.0, real]]
    A[2:, 2:] = np.diag([-1e8, -2e8])
    A[:2, 2:] = 1.0
    Q, T, k, integrators = stable_last(A)
    assert (k, integrators) == (0 if real < 0 else 2, 0)
    if real > 0:
        assert np.linalg.eigvals(T[:2, :2]).real == pytest.approx(2 * [real])
    np.testing.assert_allclose(Q @ T @ Q.T, A, atol=1e-6)


def test_slow_poles_of_sampled_systems():
    """One at 1 - 1e-13 beside integrators, and others at -1."""
    poles = [-1.0, 1.0, 1.0 - 1e-13, 0.5]
    A = chained(poles).A
    Q, T, k = integrators_first(A, axis_rounding(A), (-1.0, 1.0))
    assert k == 2 and sorted(np.diag(T)[:2]) == [-1.0, 1.0]
    assert not np.tril(T[:, :2], -1).any()
    np.testing.assert_allclose(Q @ T @ Q.T, A, atol=1e-14)


def test_a_slow_hidden_pole_is_not_unstable():
    """A weight's pole at -1e-6 that no input reaches was refused as an unstable mode."""
    A = np.diag([-1e-6, -1e8])
    B, C = np.array([[0.0], [1.0]]), np.ones((1, 2))
    assert visible_matrices(A, B, C)[0].tolist() == [[-1e8]]
