"""The local rational method: it follows a sharp resonance, and its variances mean what they say."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.errors import InputError
from workbench.identification import local_polynomial, local_rational

DENOMINATOR = np.poly(0.999 * np.exp(1j * np.array([0.5, -0.5]))).real


def record(samples, noise, rng):
    u = rng.normal(size=(samples, 1))
    y = np.column_stack([lfilter([0.01], DENOMINATOR, u[:, 0]), 0.3 * u[:, 0]])
    return u, y + noise * rng.normal(size=y.shape)


def truth(frequency):
    z = np.exp(2j * np.pi * frequency)
    return 0.01 / (1 + DENOMINATOR[1] / z + DENOMINATOR[2] / z**2)


def test_a_resonance_of_a_few_lines():
    u, y = record(2000, 0.0, np.random.default_rng(0))
    rational, polynomial = local_rational(u, y), local_polynomial(u, y)
    errors = [
        np.abs(each.response[:, 0, 0] - truth(each.cycles_per_sample)).max()
        for each in (rational, polynomial)
    ]
    assert errors[0] < 1e-3 * errors[1] < 1e-1


@pytest.mark.cases(0)
def test_variance_is_the_spread_of_the_errors():
    rng = np.random.default_rng(1)
    ratios = []
    for _ in range(30):
        found = local_rational(*record(1200, 1e-2, rng), degree=1, lines=22)
        error = np.abs(found.response[:, 1, 0] - 0.3) ** 2 / found.variance[:, 1, 0]
        ratios.append(error)
    assert np.mean(ratios) == pytest.approx(17 / 16, rel=0.15)
    assert found.covariance.shape == (599, 2, 2)
    np.testing.assert_allclose(found.covariance, found.covariance.conj().swapaxes(1, 2))


def test_chosen_lines_are_those_of_the_whole():
    u, y = record(1000, 0.1, np.random.default_rng(2))
    at = np.array([1, 5, 80, 499])
    some, whole = local_rational(u, y, at=at), local_rational(u, y)
    np.testing.assert_allclose(some.response, whole.response[at - 1], rtol=1e-8)


@pytest.mark.parametrize("keywords", [{"lines": 8}, {"lines": 900}, {"degree": 200}])
def test_bad_bands(keywords):
    with pytest.raises(InputError, match="lines"):
        local_rational(*record(1000, 0.1, np.random.default_rng(3)), **keywords)
