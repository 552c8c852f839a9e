"""The Kalman filter with noise given by the quality, against recursions and least squares."""

import numpy as np
import pytest
from estimator_plants import disturbed
from hypothesis import given, settings
from hypothesis import strategies as st
from timing import least_seconds

from workbench.diagnosis import KalmanEstimator, Noise, Rotation, estimate
from workbench.errors import InputError
from workbench.simulation import play

NOISE = Noise(known=0.2, disturbance=0.02, measurement=0.3, defect=5.0)


def filtering(**parts):
    return KalmanEstimator(disturbed(**parts), NOISE)


def variance(quality):
    return NOISE.measurement**2 + NOISE.defect**2 * (1 / quality**2 - 1)


def recursion(kalman, y, u, quality):
    """The textbook recursion with whole matrices: its outputs (N, z) and gains (N, seen)."""
    model, n = kalman.model, kalman.model.seen
    A, B, C, Z = model.A[:n, :n], model.B[:n], model.C[:n], model.Z[:, :n]
    x, P, outputs, gains = np.zeros(n), kalman.stationary_covariance, [], []
    for k in range(len(y)):
        M = np.zeros(n)
        if quality[k] > 0:
            M = P @ C / (C @ P @ C + variance(quality[k]))
        x = x + M * (y[k] - C @ x)
        keep = np.eye(n) - np.outer(M, C)
        R = variance(quality[k]) if quality[k] > 0 else 0.0
        P = A @ (keep @ P @ keep.T + R * np.outer(M, M)) @ A.T + kalman.Q  # Joseph's form
        outputs.append(Z @ x)
        gains.append(M)
        x = A @ x + B * u[k]
    return np.array(outputs), np.array(gains)


def simulated(kalman, samples, seed, quality):
    """A record made by the filter's own model, and the true state."""
    rng, model, n = np.random.default_rng(seed), kalman.model, kalman.model.seen
    root = np.linalg.cholesky(kalman.Q + 1e-18 * np.eye(n))
    x = np.linalg.cholesky(kalman.stationary_covariance) @ rng.standard_normal(n)
    y, states, u = np.zeros(samples), np.zeros((samples, n)), rng.standard_normal(samples)
    for k in range(samples):
        states[k] = x
        y[k] = model.C[:n] @ x + rng.standard_normal() * variance(quality[k]) ** 0.5
        x = model.A[:n, :n] @ x + model.B[:n] * u[k] + root @ rng.standard_normal(n)
    return y, u, states


@given(st.integers(0, 1000), st.booleans(), st.integers(1, 2))
@settings(derandomize=True, deadline=None, max_examples=12)
def test_streaming_is_the_textbooks_recursion(seed, coloured, harmonics):
    rng = np.random.default_rng(seed)
    kalman = filtering(
        rotation=Rotation(5.0, harmonics=tuple(range(1, harmonics + 1))), coloured=coloured
    )
    y, u = rng.standard_normal((2, 400))
    quality = np.ones(400)
    quality[50:90] = rng.uniform(0.0, 1.0, 40)
    quality[60:80] = 0.0
    found = estimate(kalman.controller, y, u, quality)
    outputs, _ = recursion(kalman, y, u, quality)
    np.testing.assert_allclose(found.outputs, outputs, rtol=1e-6, atol=1e-8 * abs(outputs).max())


def test_stationary_covariance_is_where_the_recursion_ends():
    kalman = filtering(coloured=True)
    A, C = kalman.model.A, kalman.model.C
    P = 10.0 * np.eye(len(A))
    for _ in range(20_000):
        M = P @ C / (C @ P @ C + NOISE.measurement**2)
        P = A @ (P - np.outer(M, C @ P)) @ A.T + kalman.Q
        P = (P + P.T) / 2
    np.testing.assert_allclose(kalman.stationary_covariance, P, rtol=1e-5, atol=1e-7 * abs(P).max())


def test_a_short_record_against_weighted_least_squares():
    """The last estimate solves one least-squares problem over all states and noises."""
    samples = 30
    kalman = filtering()
    model, n = kalman.model, kalman.model.seen
    quality = np.ones(samples)
    quality[10:15] = [0.6, 0.3, 0.1, 0.3, 0.6]
    y, u, _ = simulated(kalman, samples, 3, quality)
    # Unknown: x_0 and the noises (one of u, two of the oscillators each sample).
    G = np.zeros((n, 3))
    G[:3, 0] = model.plant.B[:, 0] * NOISE.known
    G[3:5, 1:] = np.eye(2) * NOISE.disturbance
    start = np.linalg.cholesky(kalman.stationary_covariance)
    state = np.zeros((n, n + 3 * samples))
    state[:, :n] = start
    mean, rows, right = np.zeros(n), [], []
    for k in range(samples):
        weight = variance(quality[k]) ** -0.5
        rows.append(weight * model.C[:n] @ state)
        right.append(weight * (y[k] - model.C[:n] @ mean))
        last, last_mean = state.copy(), mean.copy()
        state, mean = model.A[:n, :n] @ state, model.A[:n, :n] @ mean + model.B[:n] * u[k]
        state[:, n + 3 * k : n + 3 * k + 3] += G
    rows.extend(np.eye(n + 3 * samples))
    right.extend(np.zeros(n + 3 * samples))
    solution = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]
    expected = model.Z[:, :n] @ (last_mean + last @ solution)
    found = estimate(kalman.controller, y, u, quality).outputs[-1]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_errors_have_the_size_that_it_states_and_a_defect_is_bridged():
    kalman = filtering(coloured=True)
    model, n = kalman.model, kalman.model.seen
    quality = np.ones(20_000)
    for start in range(500, 20_000, 1000):
        quality[start : start + 100] = 0.05
    y, u, states = simulated(kalman, len(quality), 7, quality)
    best = estimate(kalman.controller, y, u, quality).outputs[:, 1]
    blind = estimate(kalman.controller, y, u, np.ones(len(y))).outputs[:, 1]
    scaled = estimate(kalman.steady_state.controller, y, u, quality).outputs[:, 1]
    truth = states @ model.Z[1, :n]
    P, C = kalman.stationary_covariance, model.C[:n]
    after = P - np.outer(P @ C, C @ P) / (C @ P @ C + NOISE.measurement**2)
    good = np.flatnonzero(np.convolve(quality < 1, np.ones(400))[: len(quality)] == 0)
    stated = (model.Z[1, :n] @ after @ model.Z[1, :n]) ** 0.5
    assert np.std((best - truth)[good]) == pytest.approx(stated, rel=0.1)
    size = [np.sqrt(np.mean((each - truth) ** 2)) for each in (best, scaled, blind)]
    assert size[0] < size[1] < size[2]


def test_it_rests_where_it_has_settled_and_wakes():
    kalman = filtering()
    y, u = np.random.default_rng(2).standard_normal((2, 3000))
    quality = np.ones(3000)
    quality[1000:1010] = 0.0
    rested = estimate(kalman.steady_state.controller, y, u, np.ones(3000)).outputs
    found = estimate(kalman.controller, y, u, quality).outputs
    np.testing.assert_allclose(found[:1000], rested[:1000], rtol=1e-9, atol=1e-12)
    assert abs(found - rested)[1010:1020].max() > 1e-3
    np.testing.assert_allclose(found[-200:], rested[-200:], atol=1e-3 * abs(rested).max())


def test_fifty_times_real_time_with_two_scratches_in_a_revolution():
    y, u = np.random.default_rng(0).standard_normal((2, 35_000))
    quality = np.ones(35_000)
    for start in range(1000, 35_000, 3500):
        quality[start : start + 35] = 0.0
    controller = filtering(coloured=True, beside=True).controller
    given = np.column_stack([y, u, quality])
    play(controller, given[:10])
    assert least_seconds(lambda: play(controller, given), 15) < 1 / 50


@pytest.mark.parametrize("values", [(-0.1, 1, 1, 1), (1, 0, 1, 1), (1, 1, 0, 1), (1, 1, 1, np.nan)])
def test_noise_that_is_none(values):
    with pytest.raises(InputError, match=r"deviations must be finite|must be positive"):
        Noise(*values)


def test_quality_outside_its_range_is_told():
    controller = filtering().controller
    with pytest.raises(InputError, match="not finite at sample 1"):
        play(controller, [[0.0, 0.0, 1.0], [0.0, 0.0, 1.2]])


def test_doubling_solves_the_riccati_equation():
    from scipy.linalg import solve_discrete_are

    from workbench.diagnosis.estimators.kalman import _riccati_by_doubling

    rng = np.random.default_rng(5)
    for _ in range(20):
        A, C = rng.normal(size=(5, 5)), rng.normal(size=(1, 5))
        expected = solve_discrete_are(A.T, C.T, np.eye(5), np.eye(1))
        np.testing.assert_allclose(_riccati_by_doubling(A, C.T @ C, np.eye(5)), expected, rtol=1e-8)
