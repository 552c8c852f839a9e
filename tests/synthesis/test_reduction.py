"""Reduced controllers against SLICOT, the theory's bounds, and the loops that they close."""

import control
import numpy as np
import pytest
import slycot
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_lyapunov
from workbench.plants.mass_spring.plant import simple_controller, two_mass_plant

from workbench.errors import InputError
from workbench.mu import conditions
from workbench.structure import Real, Structure
from workbench.synthesis import MixedSensitivity, approximate, hinf, reduce_order
from workbench.systems.equations.gramians import gramian_factors
from workbench.systems.generalised_plant import GeneralisedPlant


def random_controller(seed, kept=0):
    """Stable but for `kept` poles, in odd units of time and states."""
    rng = np.random.default_rng(seed)
    n, m, p = (int(k) for k in (rng.integers(4, 10), *rng.integers(1, 4, 2)))
    A = rng.normal(size=(n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(n)
    for k in range(kept):
        A[k, :], A[:, k] = 0.0, 0.0
        A[k, k] = [0.0, 0.7][k % 2]
    units, rate = np.exp(rng.normal(size=n)), 10 ** rng.uniform(-4, 5)
    A = A * units[:, None] / units * rate
    B, C = rng.normal(size=(n, m)) * units[:, None] * rate, rng.normal(size=(p, n)) / units
    return control.ss(A, B, C, rng.normal(size=(p, m)))


def hankel_values(system):
    """Largest first, from Gramians that are formed, in scaled time."""
    rate = np.linalg.norm(system.A)
    P = solve_continuous_lyapunov(system.A / rate, -system.B @ system.B.T / rate**2)
    Q = solve_continuous_lyapunov(system.A.T / rate, -system.C.T @ system.C)
    return np.sort(np.sqrt(np.abs(np.linalg.eigvals(P @ Q))))[::-1]


@pytest.fixture(scope="module")
def loop():
    """The two masses, and an optimal controller of 20 states for scaled perturbation channels."""
    plant = two_mass_plant()
    s = control.tf("s")

    def lag(omega, ratio):
        return control.ss((s + omega * ratio) / (s + omega / ratio) / ratio)

    scalings = [
        lag(3, 1.6) * lag(20, 1.4) * lag(0.3, 0.8),
        lag(1, 1.5) * lag(5, 0.7) * lag(60, 1.3),
    ]
    z, w = plant.performance + 1, plant.exogenous + 1
    left = control.append(*scalings, control.ss([], [], [], np.eye(z)))
    right = control.append(*(1 / d for d in scalings), control.ss([], [], [], np.eye(w)))
    K = hinf(GeneralisedPlant(left * plant.system * right, None, 1, 1)).K
    assert K.nstates == 20
    return plant, K


# --- methods ----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_factors_solve_the_lyapunov_equations(seed):
    K = random_controller(seed)
    rate = np.linalg.norm(K.A)
    A, B, C = K.A / rate, K.B / rate, K.C
    S, R = gramian_factors(A, B, C)
    P, Q = S @ S.T, R.T @ R
    assert np.allclose(A @ P + P @ A.T, -B @ B.T, atol=1e-9 * np.linalg.norm(P))
    assert np.allclose(A.T @ Q + Q @ A, -C.T @ C, atol=1e-9 * np.linalg.norm(Q))


@pytest.mark.parametrize("kept", [0, 2])
@pytest.mark.parametrize("seed", range(4))
def test_balanced_truncation_is_that_of_slicot(seed, kept):
    K = random_controller(seed, kept)
    rate = np.linalg.norm(K.A)
    n, m, p = K.nstates, K.ninputs, K.noutputs
    order = kept + (n - kept) // 2
    _, A, B, C, *_ = slycot.ab09md(
        "C", "B", "S", n, m, p, K.A / rate, K.B / rate, K.C.copy(), alpha=-1e-9, nr=order
    )
    theirs, ours = control.ss(rate * A, rate * B, C, K.D), approximate(K, order, method="balanced")
    omega = rate * np.logspace(-4, 3, 40)
    expected = theirs(1j * omega, squeeze=False)
    assert ours.nstates == order
    assert ours(1j * omega, squeeze=False) == pytest.approx(
        expected, abs=1e-7 * np.abs(expected).max()
    )


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_the_hankel_norm_of_the_error_is_the_next_singular_value(seed):
    K = random_controller(seed)
    values = hankel_values(K)
    for order in (0, 1, K.nstates // 2):
        K_r = approximate(K, order, method="hankel")
        assert K_r.nstates == order
        assert hankel_values(K - K_r)[0] == pytest.approx(values[order], rel=1e-5)
        balanced = hankel_values(K - approximate(K, order, method="balanced"))[0]
        assert balanced >= values[order] * (1 - 1e-5)


@pytest.mark.parametrize("method", ["balanced", "matchdc"])
@pytest.mark.parametrize("seed", range(3))
def test_the_error_of_balanced_truncation_is_below_twice_the_rest(seed, method):
    K = random_controller(seed)
    values = hankel_values(K)
    for order in range(K.nstates):
        error = control.linfnorm(K - approximate(K, order, method=method))[0]
        rounding = 1e-7 * values.sum()  # of linfnorm, where almost nothing is left out
        assert error <= 2 * values[order:].sum() * (1 + 1e-6) + rounding


@pytest.mark.parametrize("order", range(4))
def test_states_at_rest_keep_the_response_at_zero_frequency(order):
    K = random_controller(1)
    small, peer = (
        approximate(K, order, method="matchdc"),
        control.balred(K, order, method="matchdc"),
    )
    np.testing.assert_allclose(small(0), K(0), rtol=1e-8)
    np.testing.assert_allclose(small(2.0j), peer(2.0j), rtol=1e-5)


@pytest.mark.parametrize("method", ["balanced", "matchdc", "hankel"])
@pytest.mark.parametrize("order", range(1, 5))
def test_states_that_nothing_sees_are_no_obstacle(method, order):
    K = control.ss(np.diag([-1.0, -2.0, -3.0, -4.0]), [[1.0], [1.0], [0.0], [0.0]],
                   [[1.0, 2.0, 1.0, 1.0]], 0.5)  # fmt: skip
    small = approximate(K, order, method=method)
    assert small.nstates <= order
    if order >= 2:
        np.testing.assert_allclose(small(1.0j), K(1.0j), rtol=1e-6)


@pytest.mark.parametrize("method", ["balanced", "matchdc", "hankel"])
def test_unstable_poles_and_integrators_are_kept(method):
    K = random_controller(3, kept=2)
    unstable = sorted(pole for pole in K.poles().real if pole > -1e-9 * np.abs(K.poles()).max())
    small = approximate(K, 3, method=method)
    scale = np.abs(K.poles()).max()
    found = sorted(small.poles().real)[-2:]
    assert found == pytest.approx(unstable, abs=1e-9 * scale)
    with pytest.raises(InputError, match="must lie between 2"):
        approximate(K, 1, method=method)


def test_singular_values_that_coincide_go_together():
    """Two equal channels: Hankel singular values are double, no best order lies between."""
    G = control.ss([[-1.0, 0.5], [-0.5, -3.0]], [[1.0], [0.4]], [[0.3, 1.0]], 0.0)
    K = control.append(G, G)
    values = hankel_values(K)
    for order in (2, 3):
        small = approximate(K, order, method="hankel")
        assert small.nstates == 2
        assert hankel_values(K - small)[0] == pytest.approx(values[2], rel=1e-6)


def test_slow_and_lightly_damped_modes_survive():
    """They ring in the loop although they hardly show in K's gain at other frequencies."""
    slow = control.tf([1.0, 0.3], [1.0, 1e-6])
    notch = control.tf([1.0, 0.2, 40.0], [1.0, 0.004, 40.0])
    extra = control.ss(control.tf([1.0, 95.0, 3e3], [1.0, 100.0, 3e3]))
    K = control.ss(slow) * control.ss(notch) * extra * simple_controller()
    for method in ("balanced", "matchdc", "hankel"):
        poles = approximate(K, 4, method=method).poles()
        assert np.abs(poles + 1e-6).min() < 1e-7
        assert np.abs(poles - (-0.002 + 6.3246j)).min() < 1e-3


# --- the closed loop --------------------------------------------------------------------------


@pytest.mark.slow
def test_how_low_the_order_can_go(loop):
    plant, K = loop
    found = {
        method: reduce_order(plant, K, target=4.0, method=method)
        for method in ("weighted", "balanced")
    }
    for reduction in found.values():
        given = reduction.tried[-1]
        assert given.order == 20
        assert given.upper == pytest.approx(conditions(plant, K).robust_performance.upper)
        assert reduction.curve.shape == (len(reduction.tried), 3)
        assert (np.diff(reduction.curve[:, 0]) > 0).all()
        small = reduction.smallest
        assert small.stable and small.upper <= 4.0
        for one in reduction.tried:
            poles = plant.close(one.K).poles()
            assert one.stable == bool(poles.real.max() < 0)
            assert one.order == one.K.nstates
            assert np.isfinite(one.upper) == one.stable
        below = [one for one in reduction.tried if one.order < small.order]
        assert all(not one.stable or one.upper > 4.0 for one in below)
    assert found["weighted"].smallest.order < found["balanced"].smallest.order


def test_the_reduced_loop_withstands_sampled_perturbations(loop):
    plant, K = loop
    small = reduce_order(plant, K, target=3.5, order=7)
    assert [one.order for one in small.tried] == [7, 20]
    assert repr(small).count("\n") == 3 and "order 7, stable itself, fastest pole" in repr(small)
    assert repr(small.tried[0]).startswith("ReducedController: order 7, ")
    one = small.tried[0]
    N = plant.close(one.K)
    rng = np.random.default_rng(0)
    omega = np.logspace(-2, 2, 60)
    response = np.moveaxis(N(1j * omega, squeeze=False), -1, 0)
    for _ in range(100):
        phase = np.exp(2j * np.pi * rng.random())
        Delta = np.diag([phase, rng.uniform(-1, 1)]) / one.upper
        M11, M12, M21, M22 = plant.partition(response)
        closed = M22 + M21 @ np.linalg.solve(np.eye(2) - Delta @ M11, Delta @ M12)
        assert np.linalg.norm(closed, 2, axis=(1, 2)).max() <= one.upper * (1 + 1e-9)


def test_weighted_truncation_of_every_state_changes_nothing(loop):
    plant, K = loop
    full = approximate(K, 20, method="weighted", plant=plant)
    omega = np.logspace(-3, 3, 50)
    expected = K(1j * omega)
    assert full(1j * omega) == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())


def test_a_hidden_part_goes_first(loop):
    """States of K that the loop does not see: weighted truncation returns at most the rest."""
    plant, K = loop
    ballast = control.ss(np.diag([-2.0, -5.0]), np.zeros((2, 1)), np.ones((1, 2)), 0.0)
    found = reduce_order(plant, K + ballast, order=20)
    assert found.tried[0].upper == pytest.approx(found.tried[-1].upper, rel=2e-3)


def test_without_uncertainty_the_gain_is_kept():
    s = control.tf("s")
    G = control.ss(1 / ((s + 1) * (s + 0.01) * (s + 100) * (s + 120)) * 1e4)
    plant = MixedSensitivity(G, W_S=(0.5 * s + 1) / (s + 1e-3), W_KS=0.1).plant
    answer = hinf(plant)
    found = reduce_order(plant, answer.K, target=1.3 * answer.norm)
    given = found.tried[-1]
    assert given.upper == pytest.approx(answer.norm, rel=5e-3)
    assert found.smallest.order < answer.K.nstates
    assert control.linfnorm(plant.close(found.smallest.K))[0] <= found.smallest.upper * (1 + 1e-6)
    # The near-integrator that the weight asks for is there still.
    assert np.abs(found.smallest.K.poles() + 1e-3).min() < 1e-4


def test_without_performance_robust_stability_is_kept():
    A, B = [[0.0, 1.0], [-1.0, -0.4]], [[0.0, 0.0], [0.3, 1.0]]
    system = control.ss(A, B, [[1.0, 0.0], [1.0, 0.0]], np.zeros((2, 2)))
    plant = GeneralisedPlant(system, Structure([Real(1)]), 1, 1)
    K = control.ss(control.tf([-0.5, -1.0], [1.0, 30.0, 200.0]))
    found = reduce_order(plant, K)
    assert found.smallest.order == 0
    assert found.tried[-1].upper == pytest.approx(conditions(plant, K).robust_stability.upper)


def test_no_order_may_do():
    K = simple_controller()
    found = reduce_order(two_mass_plant(), K, target=1e-3)
    assert found.smallest is None
    assert [one.order for one in found.tried] == [0, 1]


# --- bad input --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"order": -1}, "order is -1"),
        ({"order": 9}, "between 0 and 1"),
        ({"method": "magic"}, "'magic'"),
        ({"plant": None}, "give the plant"),
        ({"controller": control.ss(0.5, 1, 1, 0, 0.1)}, "sampled"),
        ({"controller": control.ss(-1e3, 1e3, -1e3, 0)}, "unstable"),
    ],
)
def test_bad_input_is_named(change, words):
    given = {"controller": simple_controller(), "order": 0, "plant": two_mass_plant()} | change
    with pytest.raises(InputError, match=words):
        approximate(**given)


def test_a_target_must_be_positive():
    with pytest.raises(InputError, match="target is 0"):
        reduce_order(two_mass_plant(), simple_controller(), target=0.0)
