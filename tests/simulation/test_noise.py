"""Size and band of noise."""

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.simulation import band_limited_noise


def test_size_band_and_independence():
    noise = band_limited_noise(np.random.default_rng(3), (100_000, 2), 2.0, 1750.0, 1 / 35e3)
    np.testing.assert_allclose(noise.std(axis=0), 2.0, rtol=0.03)
    power = abs(np.fft.rfft(noise * np.hanning(len(noise))[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(noise), 1 / 35e3)
    assert power[frequency > 1760].sum() < 1e-5 * power.sum()
    low, high = (power[(frequency > f) & (frequency < f + 875)].mean() for f in (0, 875))
    assert low == pytest.approx(high, rel=0.1)
    assert abs(np.corrcoef(noise.T)[0, 1]) < 0.05
    assert abs(np.corrcoef(noise[:500, 0], noise[-500:, 0])[0, 1]) < 0.5


def test_seed_decides():
    first, again, other = (
        band_limited_noise(np.random.default_rng(seed), (500, 1), 1.0, 100.0, 1 / 1e3)
        for seed in (1, 1, 2)
    )
    assert (first == again).all()
    assert (first != other).any()


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_short(samples):
    noise = band_limited_noise(np.random.default_rng(0), (samples, 1), 1.0, 500.0, 1 / 1e3)
    assert noise.shape == (samples, 1)
    assert np.isfinite(noise).all()


@pytest.mark.parametrize("band", [0.0, -1.0, 600.0, np.nan])
def test_bands_that_are_none(band):
    with pytest.raises(InputError, match="half the rate"):
        band_limited_noise(np.random.default_rng(0), (10, 1), 1.0, band, 1 / 1e3)
