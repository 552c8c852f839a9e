"""Multisines and the lines of periodic records."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.identification import Multisine, line_amplitudes, odd_lines, random_multisine


@pytest.mark.parametrize("samples", [64, 65])
def test_lines_come_back(samples):
    lines, amplitudes, phases = [1, 3, 31], [1.0, 2.0, 0.5], [0.3, -2.0, 1.0]
    record = np.tile(Multisine(lines, amplitudes, phases, samples).period(), 3) + 7.0
    found = line_amplitudes(record, samples)
    exact = np.zeros(samples // 2 + 1, dtype=complex)
    exact[lines] = amplitudes * np.exp(1j * np.array(phases))
    exact[0] = 7.0
    np.testing.assert_allclose(found, np.tile(exact, (3, 1)), atol=1e-12)


def test_the_last_line_of_an_even_period_is_an_amplitude_too():
    found = line_amplitudes(np.tile([1.5, -0.5], 8), 4)
    np.testing.assert_allclose(found, np.tile([0.5, 0.0, 1.0], (4, 1)), atol=1e-12)


def test_random_phases_give_the_amplitudes_asked_for():
    signal = random_multisine([2, 5], 3.0, 100, np.random.default_rng(0))
    assert np.sqrt(np.mean(signal.period() ** 2)) == pytest.approx(3.0)
    assert 1 < signal.crest_factor < 2


@settings(derandomize=True, deadline=None)
@given(st.integers(1, 50), st.integers(10, 300), st.integers(2, 6), st.integers(0, 99))
def test_odd_lines_are_split_into_excited_and_silent(first, width, group, seed):
    last = first + 2 * group + width
    excited, silent = odd_lines(first, last, group, np.random.default_rng(seed))
    every = np.sort(np.concatenate([excited, silent]))
    odd = np.arange(first, last + 1)
    np.testing.assert_array_equal(every, odd[odd % 2 == 1])
    assert len(silent) == len(every) // group
    chunks = every[: len(silent) * group].reshape(-1, group)
    assert (np.isin(chunks, silent).sum(axis=1) == 1).all()


@pytest.mark.parametrize(
    ("lines", "amplitudes", "message"),
    [
        ([1, 8], 1.0, "Nyquist"),
        ([0, 1], 1.0, "rise from 1"),
        ([3, 2], 1.0, "rise"),
        ([1.5], 1.0, "whole numbers"),
        ([], 1.0, "whole numbers"),
        ([1, 2], [1.0, 0.0], "positive"),
        ([1, 2], [1.0, 2.0, 3.0], "2 are needed"),
    ],
)
def test_bad_lines(lines, amplitudes, message):
    with pytest.raises(InputError, match=message):
        Multisine(lines, amplitudes, np.zeros(len(lines)), 16)


def test_bad_records_and_groups():
    with pytest.raises(InputError, match="2 periods of 40 and 20 samples over"):
        line_amplitudes(np.zeros(100), 40)
    with pytest.raises(InputError, match="0 periods of 200"):
        line_amplitudes(np.zeros(100), 200)
    with pytest.raises(InputError, match="two samples"):
        line_amplitudes(np.zeros(100), 1)
    with pytest.raises(InputError, match="phases"):
        Multisine([1, 2], 1.0, [0.0], 16)
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="group"):
        odd_lines(1, 100, 1, rng)
    with pytest.raises(InputError, match="no 4 odd lines"):
        odd_lines(1, 5, 4, rng)
