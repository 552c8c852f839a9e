"""Distortion: harmonics of a sine and silent lines of a multisine."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.errors import InputError
from workbench.identification import (
    harmonic_distortion,
    line_amplitudes,
    line_distortion,
    odd_lines,
    random_multisine,
    sine_fit,
    total_harmonic_distortion,
)


def test_known_harmonics():
    assert total_harmonic_distortion([2.0, 0.3j, -0.4]) == pytest.approx(0.25)
    assert total_harmonic_distortion(np.ones((3, 2))).tolist() == [1, 1, 1]


def test_clipped_cubic():
    """x - x^3 / 3 of a unit cosine is 3/4 of it less 1/12 of its third harmonic."""
    x = np.cos(2 * np.pi * 0.0101 * np.arange(1000))
    amplitudes = sine_fit(x - x**3 / 3, 1 / 1.0, 0.0101, harmonics=5).mean(axis=0)
    assert total_harmonic_distortion(amplitudes) == pytest.approx(1 / 9)


@pytest.mark.parametrize("bad", [[1.0], [0.0, 1.0], 3.0])
def test_bad_amplitudes(bad):
    with pytest.raises(InputError):
        total_harmonic_distortion(bad)


def measured(nonlinearity, seed=0, size=1e-3):
    rng = np.random.default_rng(seed)
    excited, _ = odd_lines(1, 100, 4, rng)
    signal = random_multisine(excited, 0.1, 1024, rng).period()
    record = np.tile(nonlinearity(signal), 8) + size * rng.normal(size=8 * 1024)
    return line_distortion(line_amplitudes(record, 1024), excited)


def test_a_linear_system_passes():
    found = [measured(lambda x: 2 * x, seed) for seed in range(100)]
    assert sum(one.detected(level=0.05) for one in found) <= 14  # of 5 expected
    assert found[0].noise == pytest.approx(2 * 1e-3 / np.sqrt(8 * 1024), rel=0.2)
    assert found[0].excited == pytest.approx(0.2, rel=1e-3)


def test_even_and_odd_distortion_are_told_apart():
    even = measured(lambda x: x + 0.01 * x**2)
    odd = measured(lambda x: x + 0.01 * x**3)
    assert even.even_p < 1e-6 < 1e-3 < even.odd_p
    assert odd.odd_p < 1e-6 < 1e-3 < odd.even_p
    assert even.even > 10 * even.odd


def test_without_noise():
    assert not measured(lambda x: x, size=0).odd > 1e-12
    assert measured(lambda x: x**3, size=0).detected()


def test_bad_input():
    with pytest.raises(InputError, match="two periods"):
        line_distortion(np.ones((3, 10)), [1, 5], transients=2)
    with pytest.raises(InputError, match="must be odd"):
        line_distortion(np.ones((3, 10)), [1, 4])
    with pytest.raises(InputError, match="no odd line"):
        line_distortion(np.ones((3, 10)), [1, 3, 5])


def harmonics(nonlinearity, seed=0, size=1e-2):
    """Amplitudes (3, 10, 5) of sines of unit size behind a nonlinearity, with white noise."""
    rng, found = np.random.default_rng(seed), []
    for frequency in (0.01, 0.02, 0.04):
        x = np.cos(2 * np.pi * frequency * np.arange(round(10 / frequency)))
        noisy = nonlinearity(x) + size * rng.normal(size=len(x))
        found.append(sine_fit(noisy, 1 / 1.0, frequency, harmonics=5)[:10])
    return np.array(found)


def test_harmonics_of_sines_tell_even_from_odd():
    cubic = harmonic_distortion(harmonics(lambda x: x - x**3 / 3))
    assert cubic.odd / cubic.excited == pytest.approx(1 / 9 / np.sqrt(2), rel=1e-2)
    assert cubic.odd_p < 1e-6 < 1e-3 < cubic.even_p
    square = harmonic_distortion(harmonics(lambda x: x + 0.1 * x**2))
    assert square.even / square.excited == pytest.approx(0.05 / np.sqrt(2), rel=2e-2)
    assert square.even_p < 1e-6 < 1e-3 < square.odd_p


@pytest.mark.cases(0)
def test_squares_are_unbiased():
    """Of a linear system they are zero in the mean, and their roots are not."""
    found = [harmonic_distortion(harmonics(lambda x: 2 * x, seed, 0.3)) for seed in range(300)]
    squares = np.array([one.odd_square for one in found])
    assert abs(squares.mean()) < 3 * squares.std() / np.sqrt(len(squares))
    assert np.mean(squares < 0) == pytest.approx(0.5, abs=0.15)
    assert sum(one.detected(level=0.05) for one in found) <= 30  # of 15 expected
    lines = [measured(lambda x: x, seed).odd_square for seed in range(100)]
    assert abs(np.mean(lines)) < 3 * np.std(lines) / 10


def test_noise_is_seen_only_behind_the_transients():
    amplitudes = harmonics(lambda x: x, size=0)
    amplitudes[:, 0, 2] = 1.0
    assert harmonic_distortion(amplitudes, transients=1).odd < 1e-12
    assert harmonic_distortion(amplitudes).odd_p > 0.1


def test_slow_noise_is_not_taken_for_distortion_nor_hides_it():
    """A single period hardly tells a harmonic from noise far below it."""
    rng, squares, alarms = np.random.default_rng(3), [], 0
    for _ in range(200):
        noise = lfilter([0.05], [1, -0.99], rng.normal(size=1000))
        found = sine_fit(np.cos(0.02 * np.pi * np.arange(1000)) + noise, 1 / 1.0, 0.01, harmonics=5)
        one = harmonic_distortion(found[None])
        squares.append(one.odd_square)
        alarms += one.detected(level=0.05)
    assert abs(np.mean(squares)) < 4 * np.std(squares) / np.sqrt(200)
    assert alarms <= 22  # of 10 expected


def test_bad_harmonics():
    with pytest.raises(InputError, match="three harmonics"):
        harmonic_distortion(np.ones((2, 4, 2)))
    with pytest.raises(InputError, match="three harmonics"):
        harmonic_distortion(np.ones((4, 5)))
    with pytest.raises(InputError, match="two periods"):
        line_distortion(np.ones((3, 10)), [1, 5], transients=2)
    with pytest.raises(InputError, match="three periods"):
        harmonic_distortion(np.ones((2, 3, 5)), transients=1)
    with pytest.raises(InputError, match="periods, lines"):
        line_distortion(np.ones(10), [1, 5])
