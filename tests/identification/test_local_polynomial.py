"""The local polynomial method: unbiased, with variances that mean what they say."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.errors import InputError
from workbench.identification.responses.local_polynomial import local_polynomial


def record(samples, noise, rng):
    """Two inputs, one coloured, and two outputs with coloured noise."""
    u = rng.normal(size=(samples, 2))
    u[:, 1] = lfilter([1.0], [1.0, -0.9], u[:, 1])
    y = np.column_stack(
        [
            lfilter([0.5], [1.0, -0.5], u[:, 0]) + 0.3 * u[:, 1],
            lfilter([1.0, 0.4], [1.0], u[:, 1]),
        ]
    )
    return u, y + noise * lfilter([1.0, 0.5], [1.0], rng.normal(size=y.shape), axis=0)


def truth(frequency):
    z = np.exp(2j * np.pi * frequency)
    response = np.zeros((len(frequency), 2, 2), complex)
    response[:, 0, 0] = 0.5 / (1 - 0.5 / z)
    response[:, 0, 1] = 0.3
    response[:, 1, 1] = 1 + 0.4 / z
    return response


def test_without_noise():
    estimate = local_polynomial(*record(2000, 0.0, np.random.default_rng(0)))
    assert np.max(abs(estimate.response - truth(estimate.frequency))) < 1e-3
    assert estimate.frequency[0] == pytest.approx(1 / 2000) and estimate.frequency[-1] < 0.5


def test_variance_is_the_spread_of_the_errors():
    rng = np.random.default_rng(1)
    ratios = []
    for _ in range(20):
        estimate = local_polynomial(*record(400, 0.2, rng))
        ratios.append(abs(estimate.response - truth(estimate.frequency)) ** 2 / estimate.variance)
    # Noise estimated with eight degrees of freedom: the ratio's mean is 8/7, not 1.
    np.testing.assert_allclose(np.mean(ratios, axis=(0, 1)), 8 / 7, rtol=0.1)


def test_covariance_is_hermitian_and_ordered_by_rows():
    estimate = local_polynomial(*record(400, 0.2, np.random.default_rng(2)))
    assert estimate.covariance.shape == (199, 4, 4)
    np.testing.assert_allclose(estimate.covariance, estimate.covariance.conj().swapaxes(1, 2))
    # The coloured input is strong at low frequencies, where its response is known better.
    low = estimate.variance[:20].mean(axis=0)
    assert (low[:, 1] < low[:, 0]).all()


@pytest.mark.parametrize("keywords", [{"lines": 9}, {"lines": 500}, {"degree": 200}])
def test_bad_bands(keywords):
    with pytest.raises(InputError, match="lines"):
        local_polynomial(*record(400, 0.1, np.random.default_rng(0)), **keywords)
