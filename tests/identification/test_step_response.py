"""Response from steps, of a system whose response is known."""

import warnings

import numpy as np
import pytest
from scipy.signal import freqz, lfilter

from workbench.errors import InputError
from workbench.identification import IdentificationWarning, step_response

RATE, LENGTH, STEPS = 100.0, 400, 12
NUMERATOR, DENOMINATOR = [0.0, 0.2, 0.1], [1.0, -1.5, 0.7]
FREQUENCY = np.array([0.3, 1.0, 5.0, 12.0])
REST = 41
STARTS = REST + LENGTH * np.arange(STEPS)


def truth():
    return freqz(NUMERATOR, DENOMINATOR, FREQUENCY, fs=RATE)[1]


def record(size, seed=0, sizes=None):
    levels = np.where(np.arange(STEPS) % 2 == 0, 1.0, 0.0) if sizes is None else np.cumsum(sizes)
    u = np.concatenate([np.zeros(REST), np.repeat(levels, LENGTH)])
    noise = np.random.default_rng(seed).standard_normal(len(u))
    return u, lfilter(NUMERATOR, DENOMINATOR, u) + 3.0 + size * noise


def measured(u, y, **changed):
    given = {"starts": STARTS, "length": LENGTH, "frequency_hz": FREQUENCY} | changed
    return step_response(u, y, dt=1 / RATE, **given)


def test_without_noise_the_response_is_exact():
    found = measured(*record(0.0))
    np.testing.assert_allclose(found.response[:, 0, 0], truth(), rtol=1e-9)


def test_steps_of_any_size_and_sign():
    sizes = np.random.default_rng(5).uniform(0.5, 2.0, STEPS) * (-1.0) ** np.arange(STEPS)
    found = measured(*record(0.0, sizes=sizes))
    np.testing.assert_allclose(found.response[:, 0, 0], truth(), rtol=1e-9)


def test_regions_hold_the_truth():
    found = [measured(*record(0.02, seed)) for seed in range(60)]
    held = [abs(one.response[:, 0, 0] - truth()) <= one.radius()[:, 0, 0] for one in found]
    assert np.mean(held) > 0.95
    errors = np.array([one.response[:, 0, 0] - truth() for one in found])
    stated = np.mean([one.variance[:, 0, 0] for one in found], axis=0)
    np.testing.assert_allclose(np.mean(abs(errors) ** 2, axis=0), stated, rtol=0.5)


def test_noise_of_neighbouring_steps_is_independent():
    """At low frequencies the samples at the ends of a step would outweigh all others."""
    frequency = np.array([0.5, 0.75])
    sizes = 2.0 * (-1.0) ** np.arange(STEPS)
    truth = freqz(NUMERATOR, DENOMINATOR, frequency, fs=RATE)[1]
    held = []
    for seed in range(150):
        u, y = record(0.02, seed, sizes)
        one = measured(u, y, frequency_hz=frequency)
        held.append(abs(one.response[:, 0, 0] - truth) <= one.radius()[:, 0, 0])
    assert np.mean(held) > 0.97


def test_noise_grows_with_frequency():
    """The noise of the differences does; those of the step are equal at all frequencies."""
    deviation = np.sqrt(measured(*record(0.02)).variance[:, 0, 0])
    assert deviation[-1] > 5 * deviation[0]


def test_an_output_that_still_moves_is_told():
    u, y = record(1e-4)
    with pytest.warns(IdentificationWarning, match="still moves"):
        measured(u, y, length=30)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        measured(u, y)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"starts": [1]}, "two steps"),
        ({"starts": [1.5, 500.0]}, "two steps"),
        ({"length": 10}, "two steps"),
        ({"starts": [40, 500]}, "must not overlap"),
        ({"starts": [50, 150]}, "must not overlap"),
        ({"starts": [50, 4500]}, "must not overlap"),
        ({"frequency_hz": [0.0]}, "frequencies"),
        ({"frequency_hz": [50.0]}, "frequencies"),
        ({"starts": [90, 890]}, "no step"),
    ],
)
def test_bad_requests(changed, words):
    u, y = record(0.01)
    with pytest.raises(InputError, match=words):
        measured(u, y, **({"length": 340} if changed == {"starts": [90, 890]} else {}) | changed)


def test_records_of_different_length():
    u, y = record(0.01)
    with pytest.raises(InputError, match="shape"):
        measured(u[1:], y)
