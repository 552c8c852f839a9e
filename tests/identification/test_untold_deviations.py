"""What a record does not tell has an infinite deviation: few sines, and slow modes with offsets."""

import numpy as np
import pytest
from scipy.signal import lfilter

from problems.bench.regions.plants import PLANTS
from problems.bench.regions.records import EXCITATIONS
from workbench import solve
from workbench.identification import StateSpaceFit, arx, as_experiments, response_deviations
from workbench.identification.innovations.criterion import Criterion, whitening
from workbench.identification.innovations.uncertainty import model_deviations

SINE = 0.3 / (2 * np.pi)
"""Frequency of the first sine [cycles/sample]."""


def record(sines, seed=0):
    """A lag of gain 1 under sines of these frequencies [cycles/sample]."""
    time, rng = np.arange(3000), np.random.default_rng(seed)
    u = np.sum([np.sin(2 * np.pi * f * time) for f in sines], axis=0)
    y = lfilter([0.0, 0.2], [1.0, -0.8], u) + 0.01 * rng.standard_normal(len(time))
    return as_experiments(u, y)


@pytest.mark.parametrize("seed", range(3))
def test_one_sine_tells_no_static_gain_of_second_order(seed):
    """The estimate said 1e9 +- 0 where the truth is 1."""
    told = record([SINE], seed)
    model = arx(told, order=2)
    found = model_deviations(model, told)
    assert np.isinf(found.gain_deviations).all() and np.isinf(found.pole_deviations).all()
    at = response_deviations(model, told, [SINE, 0.01, 0.2])[:, 0, 0]
    assert np.isfinite(at).tolist() == [True, False, False]


def test_enough_sines_tell_all():
    told = record([SINE, 0.011, 0.15])
    model = arx(told, order=2)
    assert np.isfinite(model_deviations(model, told).gain_deviations).all()
    assert np.isfinite(response_deviations(model, told, [0.0, 0.2])).all()


def test_one_input_of_two_may_tell_all():
    rng = np.random.default_rng(1)
    sine, noise = np.sin(2 * np.pi * SINE * np.arange(3000)), rng.standard_normal(3000)
    y = lfilter([0.0, 0.2], [1.0, -0.8], sine + 2 * noise) + 0.01 * rng.standard_normal(3000)
    told = as_experiments(np.column_stack([sine, noise]), y)
    found = model_deviations(arx(told, order=2), told).gain_deviations
    assert np.isinf(found[0]).tolist() == [True, False]


@pytest.mark.cases(1)
@pytest.mark.parametrize(("method", "told"), [("output-error", False), ("prediction-error", True)])
def test_a_free_run_of_an_integrator_does_not_tell_the_offset(method, told):
    """The mean of u is not its offset: the ramp that is left was taken for the plant."""
    rng = np.random.default_rng(2)
    u = EXCITATIONS["noise"](rng, 4000, PLANTS["arm"].band)
    y = PLANTS["arm"].output(u[None])[2000:]
    y += 0.1 * y.std() * rng.standard_normal(len(y))
    fit = StateSpaceFit(u[2000:], y, orders=(4,), direct=False)
    found = fit.deviations(solve(fit, method=method).answer, [0.01, 0.1])
    assert np.isfinite(found).all() == told


def test_a_record_repeated_with_its_own_errors_is_itself():
    rng = np.random.default_rng(3)
    u = rng.standard_normal((200, 2))
    y = lfilter([0.0, 0.5], [1.0, -0.8], u[:, 0]) + 0.1 * rng.standard_normal(200) + 3.0
    y[50:55] = np.nan
    told = as_experiments([u[:120], u[120:]], [y[:120], y[120:]])
    model = arx(told, order=2, delay_samples=(1, 3))
    criterion = Criterion(model, told, 0.0)
    theta = criterion.start(model)
    (again,) = criterion.repeated(theta, told, [criterion.errors(theta)])
    np.testing.assert_allclose(again.y, told.y, rtol=0, atol=1e-12)


def test_errors_that_are_multiples_of_each_other():
    """Two sensors of one signal: their noise has a singular covariance."""
    covariance = np.outer([1.0, 1e-6], [1.0, 1e-6]) + np.diag([1e-18, 1e-30])
    W = whitening(covariance)
    assert np.isfinite(W).all()
    assert np.linalg.norm(W.T @ covariance @ W, 2) < 1 + 1e-6
    regular = np.array([[2.0, 0.5], [0.5, 1.0]])
    assert np.allclose(whitening(regular) @ whitening(regular).T, np.linalg.inv(regular))


def test_noise_of_repeated_records_is_not_the_input():
    """Inputs of one seed had deviations 3 times as large as those of others: that of the noise."""

    def deviation(seed):
        u, v = np.random.default_rng(seed).standard_normal((2, 1000))
        told = as_experiments(u, lfilter([0.0, 0.5], [1.0, -0.5], u) + lfilter([0.1], [1, -0.5], v))
        return response_deviations(arx(told, order=1), told, [0.2]).item()

    found = [deviation(seed) for seed in range(8)]
    assert max(found) < 1.5 * min(found)
