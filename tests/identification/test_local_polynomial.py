"""The local polynomial method: unbiased, with variances that mean what they say."""

import tracemalloc

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.errors import InputError
from workbench.identification.responses.local_polynomial import (
    local_polynomial,
    polynomials_in_bands,
)


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
    assert np.max(abs(estimate.response - truth(estimate.cycles_per_sample))) < 1e-3
    assert (
        estimate.cycles_per_sample[0] == pytest.approx(1 / 2000)
        and estimate.cycles_per_sample[-1] < 0.5
    )


@pytest.mark.cases(0)
def test_variance_is_the_spread_of_the_errors():
    rng = np.random.default_rng(1)
    ratios = []
    for _ in range(20):
        estimate = local_polynomial(*record(400, 0.2, rng))
        ratios.append(
            abs(estimate.response - truth(estimate.cycles_per_sample)) ** 2 / estimate.variance
        )
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


@pytest.mark.cases(0)
def test_chosen_lines_are_those_of_the_whole():
    u, y = record(40_000, 0.1, np.random.default_rng(3))  # more lines than are held at once
    whole = local_polynomial(u, y)
    at = np.array([1, 2, 77, 8192, 8193, 19_999])
    some = local_polynomial(u, y, at=at)
    assert some.cycles_per_sample == pytest.approx(at / 40_000, rel=4 * np.finfo(float).eps)
    for name in ("response", "covariance", "noise"):
        np.testing.assert_allclose(getattr(some, name), getattr(whole, name)[at - 1], rtol=1e-9)


def test_a_long_record_takes_little_more_memory_than_its_spectra():
    rng = np.random.default_rng(4)
    u = rng.normal(size=(400_000, 1))
    y = lfilter([0.5], [1.0, -0.5], u, axis=0)
    tracemalloc.start()
    polynomials_in_bands(u, y, at=np.array([5, 50, 500]))  # the report of the record is apart
    held = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert held <= 8 * (u.nbytes + y.nbytes)


@pytest.mark.parametrize(
    "at", [[], [0, 1], [1, 1], [3, 2], [1.5], [1, 200], "all", [[1, 2]], [True, False]]
)
def test_bad_lines_are_named(at):
    u, y = record(400, 0.1, np.random.default_rng(5))
    with pytest.raises(InputError, match="from 1 to 199"):
        local_polynomial(u, y, at=at)
