"""Recursive estimates beside those of all samples at once, and on plants that change."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.errors import InputError
from workbench.identification import Experiments, RecursiveARMAX, RecursiveARX, arx

A, B, C = [1.0, -1.5, 0.7], [0.0, 1.0, 0.5], [1.0, -0.6, 0.2]


def signals(samples, seed=0, noise=0.3, C=(1.0,)):
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal(samples), noise * rng.standard_normal(samples)
    return u, lfilter(B, A, u) + lfilter(C, A, e)


def fed(estimate, u, y):
    return np.array([np.ravel(estimate.update(*each))[0] for each in zip(u, y, strict=True)])


def test_without_forgetting_it_is_least_squares_of_all_samples():
    rng = np.random.default_rng(3)
    u, y = rng.standard_normal((500, 2)), 5 + rng.standard_normal((500, 2)).cumsum(axis=0) / 9
    estimate = RecursiveARX(2, inputs=2, outputs=2)
    fed(estimate, u, y)
    found, batch = estimate.model(), arx(Experiments(u, y), 2)
    np.testing.assert_allclose(
        found.one_step(u, y, 100)[100:], batch.one_step(u, y, 100)[100:], atol=2e-4
    )


def test_with_forgetting_it_is_weighted_least_squares():
    u, y = signals(200)
    estimate = RecursiveARX(1, forgetting=0.97)
    fed(estimate, u, y)
    rows = np.column_stack([np.ones(199), u[:-1], y[:-1], u[1:]])
    weight = np.sqrt(0.97 ** np.arange(198, -1, -1))[:, None]
    expected = np.linalg.lstsq(weight * rows, weight[:, 0] * y[1:], rcond=None)[0]
    np.testing.assert_allclose(estimate.coefficients[0], expected, atol=1e-4)


def test_its_errors_are_those_of_its_own_predictions():
    u, y = signals(300)
    estimate = RecursiveARX(2, direct=False)
    errors = fed(estimate, u, y)
    assert np.isnan(errors[:2]).all() and np.isfinite(errors[2:]).all()
    assert np.std(errors[100:]) == pytest.approx(0.3, rel=0.15)
    assert not estimate.model().D.any()


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", [RecursiveARX, RecursiveARMAX])
def test_a_plant_that_changes_is_followed(kind):
    """The gain of the plant doubles half way; only an estimate that forgets finds it."""
    u, y = signals(3000, noise=0.1)
    y[1500:] += lfilter(B, A, u[1500:])
    gains = {}
    for forgetting in (1.0, 0.98):
        estimate = kind(2, forgetting=forgetting)
        fed(estimate, u, y)
        gains[forgetting] = abs(estimate.model().response([0.01])[0, 0, 0])
    z = np.exp(-2j * np.pi * 0.01)
    true = 2 * abs(np.polyval(B[::-1], z) / np.polyval(A[::-1], z))
    assert gains[0.98] == pytest.approx(true, rel=0.05)
    assert gains[1.0] < 0.9 * true


@pytest.mark.cases(0)
def test_recursive_prediction_errors_find_the_truth():
    u, y = signals(6000, seed=2, C=C)
    estimate = RecursiveARMAX(2)
    errors = fed(estimate, u, y + 4.0)
    level, a, b, c = np.split(estimate.coefficients, [1, 3, 6])
    np.testing.assert_allclose(a, A[1:], atol=0.02)
    np.testing.assert_allclose(b, [1.0, 0.5, 0.0], atol=0.03)  # the lags, then B_0
    np.testing.assert_allclose(c, C[1:], atol=0.06)
    assert level[0] == pytest.approx(4.0 * sum(A), abs=0.1)
    assert np.std(errors[3000:]) == pytest.approx(0.3, rel=0.05)
    model = estimate.model()
    left = (y + 4.0 - model.one_step(u[:, None], y[:, None] + 4.0, 50)[:, 0])[50:]
    assert np.std(left) == pytest.approx(0.3, rel=0.05)
    # An ARX model of the same order takes the noise for dynamics.
    biased = RecursiveARX(2)
    fed(biased, u, y)
    missed = np.abs(biased.coefficients[0, [2, 4]] + A[1:]).max()
    assert missed > 2 * np.abs(a - A[1:]).max()


@pytest.mark.cases(0)
def test_the_predictor_stays_stable():
    """Of noise whose C has roots beside the unit circle, in short records of many seeds."""
    for seed in range(10):
        u, y = signals(300, seed, noise=2.0, C=(1.0, -1.99, 0.9901))
        estimate = RecursiveARMAX(2, forgetting=0.95)
        for each in zip(u, y, strict=True):
            estimate.update(*each)
            assert np.abs(np.roots(estimate.noise_polynomial)).max() < 1
        assert np.isfinite(estimate.coefficients).all()


@pytest.mark.parametrize("kind", [RecursiveARX, RecursiveARMAX])
def test_what_is_none_is_refused(kind):
    for forgetting in (0.0, 1.1, True, "1"):
        with pytest.raises(InputError, match="forgetting"):
            kind(2, forgetting=forgetting)
    for order in (0, 1.5):
        with pytest.raises(InputError, match="order"):
            kind(order)
    estimate = kind(2, inputs=2)
    for u in ([1.0], [1.0, np.nan]):
        with pytest.raises(InputError, match="u is"):
            estimate.update(u, 0.0)
    with pytest.raises(InputError, match="y is"):
        estimate.update([1.0, 2.0], np.inf)


@pytest.mark.parametrize("units", [(1e-6, 1e-6), (1e-12, 1e12), (1e12, 1e-12)])
@pytest.mark.parametrize("kind", [RecursiveARX, RecursiveARMAX])
def test_units_do_not_matter(kind, units):
    u, y = signals(300)
    one, other = kind(2, direct=False), kind(2, direct=False)
    left, right = fed(one, u, y), fed(other, units[0] * u, units[1] * y)
    np.testing.assert_allclose(right[20:] / units[1], left[20:], rtol=1e-6, atol=1e-9)
    gains = [abs(each.model().response([0.01])[0, 0, 0]) for each in (one, other)]
    assert gains[1] * units[0] / units[1] == pytest.approx(gains[0], rel=1e-6)


def test_small_signals_after_a_long_rest():
    u, y = signals(3000)
    estimate = RecursiveARMAX(2, direct=False)
    fed(estimate, 1e-6 * np.r_[np.zeros(100), u], 1e-6 * np.r_[np.zeros(100), y])
    np.testing.assert_allclose(estimate.coefficients[1:3], A[1:], atol=0.05)
