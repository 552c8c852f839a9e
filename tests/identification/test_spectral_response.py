"""Responses from one arbitrary record by averaged spectra."""

import numpy as np
import pytest
from scipy import signal, stats

from workbench.errors import InputError
from workbench.identification import spectral_response


@pytest.mark.cases(0)
def test_the_regions_cover():
    """One run has many nearly independent lines: every second one of a flat system."""
    hits = runs = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u = rng.normal(size=4096)
        estimate = spectral_response(u, 2 * u + 0.5 * rng.normal(size=4096), 1 / 1.0, 128)
        inside = np.abs(estimate.response[:, 0, 0] - 2) <= estimate.radius(confidence=0.9)[:, 0, 0]
        hits, runs = hits + inside[::2].sum(), runs + inside[::2].size
    low, high = stats.binom.interval(1 - 1e-4, runs, 0.9)
    assert low <= hits <= high


@pytest.mark.cases(0)
def test_two_inputs_and_two_outputs():
    rng = np.random.default_rng(0)
    u = rng.normal(size=(2, 20_000))
    y = np.stack(
        [
            signal.lfilter([1, 0.5], [1, -0.5], u[0]) - u[1],
            0.2 * u[0] + 0.1 * rng.normal(size=20_000),
        ]
    )
    estimate = spectral_response(u, y, 1 / 10.0, 256)
    exact = signal.freqz([1, 0.5], [1, -0.5], worN=estimate.frequency_hz, fs=10.0)[1]
    assert estimate.response.shape == (127, 2, 2)
    assert np.abs(estimate.response[:, 0, 0] - exact).max() < 0.15
    assert np.abs(estimate.response[:, 1, 1]).max() < 0.05
    np.testing.assert_allclose(estimate.noise[:, 1].mean(), 0.1**2 * 2 / 10, rtol=0.1)
    assert estimate.coherence[:, 0].min() > 0.99
    assert np.mean(estimate.coherence[:, 1]) == pytest.approx(0.8, abs=0.03)


def test_bad_input():
    rng = np.random.default_rng(0)
    u = rng.normal(size=(2, 200))
    with pytest.raises(InputError, match="too few for 2 inputs"):
        spectral_response(u, u, 1 / 1.0, 100)
    with pytest.raises(InputError, match="too few"):
        spectral_response(u, u, 1 / 1.0, 400)
    with pytest.raises(InputError, match="channel 1 never changes"):
        spectral_response(u * [[1], [0]], u, 1 / 1.0, 32)
    with pytest.raises(InputError, match="move together"):
        spectral_response(u[[0, 0]], u, 1 / 1.0, 32)
    with pytest.raises(InputError, match="y has 100"):
        spectral_response(u, u[:, :100], 1 / 1.0, 32)
    with pytest.raises(InputError, match="8 samples"):
        spectral_response(u, u, 1 / 1.0, 4)
    u[1, 7] = np.nan
    with pytest.raises(InputError, match="channel 1, sample 7"):
        spectral_response(u, u, 1 / 1.0, 32)
