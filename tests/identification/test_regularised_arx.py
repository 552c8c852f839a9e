"""Long ARX models that are regularised, and ARX models of each output alone."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.identification import Experiments, arx
from workbench.identification.polynomials.regularised_arx import LAGS, regularised_arx


def record(samples, seed, noise=0.5):
    """y = B/F u + C/D e: a predictor of infinitely many lags."""
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal(samples), noise * rng.standard_normal(samples)
    y = lfilter([0.0, 1.0, 0.5], [1.0, -1.5, 0.7], u) + lfilter([1.0, 0.8], [1.0, -0.9], e)
    return Experiments(u[:, None], y[:, None])


def error(model, judged):
    return float(np.std((judged.y - model.one_step(judged.u, judged.y, 100))[100:]))


@pytest.mark.cases(0)
def test_it_predicts_better_than_least_squares_of_as_many_lags():
    judged = record(4000, 99)
    for seed in range(3):
        used = record(400, seed)
        own = error(regularised_arx(used), judged)
        plain = error(arx(used, LAGS), judged)
        assert own < 0.5 * 1.1
        assert own - 0.5 < 0.6 * (plain - 0.5)


def test_without_noise_it_is_exact_enough():
    used = record(600, 5, noise=0.0)
    assert error(regularised_arx(used), record(600, 6, noise=0.0)) < 1e-3 * used.y.std()


def test_of_several_outputs_each_may_depend_on_the_others():
    rng = np.random.default_rng(2)
    u, y = rng.standard_normal((1500, 2)), np.zeros((1500, 2))
    e = 0.1 * rng.standard_normal((1500, 2))
    lag = np.array([[0.5, 0.4], [-0.3, 0.6]])
    for t in range(1, 1500):
        y[t] = lag @ y[t - 1] + u[t - 1] + e[t]
    model = regularised_arx(Experiments(u, y))
    found = model.C @ model.K  # the first lag of the outputs
    np.testing.assert_allclose(found, lag, atol=0.05)
    alone = arx(Experiments(u, y), 1, apart=True)
    np.testing.assert_allclose(alone.C @ alone.K, np.diag(np.diag(alone.C @ alone.K)), atol=1e-14)


def test_outputs_apart_are_least_squares_of_their_own_pasts():
    rng = np.random.default_rng(4)
    u, y = rng.standard_normal((300, 1)), rng.standard_normal((300, 2)).cumsum(axis=0) * 0.1
    both = arx(Experiments(u, y), 2, apart=True)
    for o in range(2):
        single = arx(Experiments(u, y[:, [o]]), 2)
        predicted = single.one_step(u, y[:, [o]], 100)[100:, 0]
        np.testing.assert_allclose(both.one_step(u, y, 100)[100:, o], predicted, atol=1e-8)


def test_inputs_may_not_act_at_once_or_act_late():
    used = record(500, 1)
    assert not regularised_arx(used, direct=False).D.any()
    late = regularised_arx(used, delay=(2,))
    assert late.delay_samples == (2,)
    assert error(regularised_arx(used), used) == pytest.approx(0.5, rel=0.1)


def test_a_record_that_is_too_short_gives_none():
    assert regularised_arx(record(20, 0)) is None
