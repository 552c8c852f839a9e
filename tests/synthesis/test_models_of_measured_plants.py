"""Models that stand for measured plants: they do not follow the noise."""

import numpy as np
import pytest

from workbench.executor import Context
from workbench.solvers import Options
from workbench.uncertainty import Responses
from workbench.uncertainty.responses.plant_models import measured_plants

OMEGA, GAINS = np.geomspace(1e-3, 0.1, 20), np.linspace(1.0, 2.0, 8)


def lags(omega, gain):
    s = 1j * omega
    return gain * np.exp(-10.0 * s) / ((500.0 * s + 1) * (20.0 * s + 1))


@pytest.mark.cases(1)
@pytest.mark.parametrize("noise", [0.003, 0.005, 0.03])
def test_noise_makes_no_resonances(noise):
    """With 5 poles in place of 3 a model had a resonance between the frequencies."""
    rng = np.random.default_rng(0)
    exact = lags(OMEGA[:, None], GAINS)
    error = rng.standard_normal((2, *exact.shape)) / np.sqrt(2)
    values = exact + noise * np.abs(exact) * (error[0] + 1j * error[1])
    plants = Responses(omega=OMEGA, values=values, variance=(noise * np.abs(exact)) ** 2)
    models, errors = measured_plants(plants, 3, 0, Context(options=Options()))
    assert [model.poles.size for model in models] == [3] * len(GAINS)
    assert errors.max() < 2 * noise
    fine = np.geomspace(OMEGA[0], OMEGA[-1], 4000)
    for gain, model in zip(GAINS, models, strict=True):
        assert np.abs(model.response(fine) / lags(fine, gain) - 1).max() < 3 * noise
