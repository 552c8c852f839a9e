"""Stepped sines and their evaluation by least squares."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.identification import SteppedSine, sine_fit

RATE = 35e3


def test_phase_goes_on_from_step_to_step():
    steps = dict(SteppedSine([10.1, 700.3, 33.0], 3, 2.0, 1 / 1e4))
    signal = np.concatenate(list(steps.values()))
    assert np.abs(signal).max() <= 2.0
    # A sine of at most 700.3 Hz moves no faster, across the steps neither.
    assert np.abs(np.diff(signal)).max() <= 2.0 * 2 * np.pi * 700.3 / 1e4


def test_each_step_lasts_its_periods():
    sine = SteppedSine([10.0, 10.1, 2000.0], 20, [1, 2, 3], 1 / RATE)
    assert sine.lengths.tolist() == [70_000, 69_307, 350]
    for (frequency, samples), length, amplitude in zip(sine, sine.lengths, (1, 2, 3), strict=True):
        found = sine_fit(samples, 1 / RATE, frequency)
        assert len(samples) == length
        assert found.shape == (20, 1)
        np.testing.assert_allclose(np.abs(found), amplitude, rtol=1e-9)


def test_periods_of_each_step():
    assert SteppedSine([10.0, 100.0], [2, 30], 1.0, 1 / 1e3).lengths.tolist() == [200, 300]


@settings(derandomize=True, deadline=None, max_examples=50)
@given(
    st.floats(0.01, 0.13),
    st.floats(-1e3, 1e3),
    st.floats(-3, 3),
    st.floats(-3, 3),
    st.floats(0.01, 100),
)
def test_a_periodic_signal_is_found_exactly(turns, offset, phase, other, size):
    time = np.arange(500)
    first, third = size * np.exp(1j * phase), 0.3 * size * np.exp(1j * other)
    wave = np.exp(2j * np.pi * turns * time)
    found = sine_fit(offset + (first * wave + third * wave**3).real, 1 / 1.0, turns, harmonics=3)
    exact = np.broadcast_to([first, 0, third], found.shape)
    np.testing.assert_allclose(found, exact, atol=1e-9 * (size + abs(offset)))
    assert len(found) == int(500 * turns + 1e-9)


def test_channels_are_fitted_side_by_side():
    rng = np.random.default_rng(0)
    signal = rng.normal(size=(2, 3, 1000))
    found = sine_fit(signal, 1 / 100.0, 3.3)
    assert found.shape == (2, 3, 33, 1)
    np.testing.assert_allclose(found[1, 2], sine_fit(signal[1, 2], 1 / 100.0, 3.3), atol=1e-12)


def test_noise_scatters_as_least_squares_says():
    rng = np.random.default_rng(1)
    found = sine_fit(rng.normal(size=(40, 20_000)), 1 / RATE, 100.7)[..., 0]
    # The variance of an amplitude from n samples of variance 1 is 4 / n.
    assert np.mean(np.abs(found) ** 2) == pytest.approx(4 / (RATE / 100.7), rel=0.05)


def test_a_dead_channel_has_no_amplitude():
    assert not sine_fit(np.full(1000, 5.1), 1 / 100.0, 3.0).any()


@pytest.mark.parametrize(
    ("signal", "frequency", "harmonics", "message"),
    [
        (np.zeros(9), 10.0, 1, "less than one period"),
        (np.zeros(100), 50.0, 1, "Nyquist"),
        (np.zeros(100), -1.0, 1, "Nyquist"),
        (np.zeros(100), 20.0, 3, "Nyquist"),
        (np.zeros(100), 40.0, 1, "fewer harmonics"),
        ([0.0, np.nan] + [0.0] * 99, 10.0, 1, "sample 1"),
        ([], 10.0, 1, "no samples"),
        (np.zeros(100) * 1j, 10.0, 1, "real"),
    ],
)
def test_bad_input_of_the_fit(signal, frequency, harmonics, message):
    with pytest.raises(InputError, match=message):
        sine_fit(signal, 1 / 100.0, frequency, harmonics=harmonics)


@pytest.mark.parametrize(
    ("frequencies", "periods", "dt", "message"),
    [
        ([10.0, 60.0], 3, 0.01, "60 Hz .* Nyquist"),
        ([10.0], 0, 0.01, "at least one period"),
        ([10.0, 20.0], [1, 0], 0.01, "at least one period"),
        ([10.0], 1.5, 0.01, "whole numbers"),
        ([10.0], 3, 0.0, "dt is 0"),
        ([np.nan], 3, 0.01, "NaN"),
    ],
)
def test_bad_input_of_the_excitation(frequencies, periods, dt, message):
    with pytest.raises(InputError, match=message):
        SteppedSine(frequencies, periods, 1.0, dt)
