"""Bands of responses hold the truth as often as they say, for every kind of model."""

import numpy as np
import pytest
from scipy.signal import lfilter

import workbench as wb
from workbench.identification import StateSpaceFit

AT = np.array([0.01, 0.03, 0.06, 0.1, 0.2, 0.35])
B, A = [0, 0.4, 0.2], [1, -1.2, 0.6]
C, D = [1, 0.5, 0.2], [1, -0.7, 0.3]
NOISE = {
    "arx": ([1], A),
    "armax": (C, A),
    "output-error": ([1], [1]),
    "box-jenkins": (C, D),
    "prediction-error": (C, A),
    "impulse-response": ([1], [1]),
}
"""Numerator and denominator of the noise for which a kind is right."""


def share_held(kind, records):
    """Share of the 95 % bands of the magnitude that hold the exact one."""
    z = np.exp(-2j * np.pi * AT)
    exact = np.abs(np.polyval(B[::-1], z) / np.polyval(A[::-1], z))
    held = []
    for seed in range(records):
        u, e = np.random.default_rng(seed).standard_normal((2, 1000))
        y = lfilter(B, A, u) + 0.3 * lfilter(*NOISE[kind], e)
        program = StateSpaceFit(u, y, orders=[2])
        answer = wb.solve(program, method=kind).answer
        found = np.abs(answer.simulator.response(AT)[:, 0, 0])
        held.append(np.abs(found - exact) < 1.96 * program.deviations(answer, AT)[:, 0, 0])
    return np.mean(held)


@pytest.mark.slow
@pytest.mark.parametrize("kind", NOISE)
def test_bands_hold_the_truth_in_a_thousand_records(kind):
    assert 0.93 <= share_held(kind, 1000) <= 0.97


@pytest.mark.cases(0)
@pytest.mark.parametrize("kind", ["arx", "box-jenkins"])
def test_bands_hold_the_truth_in_forty_records(kind):
    assert 0.88 <= share_held(kind, 40) <= 0.995
