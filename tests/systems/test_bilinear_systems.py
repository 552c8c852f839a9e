"""The bilinear transform of systems: responses at warped frequencies, and back again."""

import control
import numpy as np
import pytest

from workbench.systems.bilinear import bilinear_continuous, bilinear_sampled

PERIOD = 0.02


def test_responses_agree_at_warped_frequencies_and_the_way_back_is_exact():
    F = control.ss([[-3.0, 20.0], [-20.0, -3.0]], [[1.0], [0.0]], [[2.0, 1.0]], [[0.5]])
    sampled = bilinear_sampled(F, PERIOD)
    assert sampled.dt == PERIOD
    w = np.geomspace(0.1, 150.0, 20)
    omega = 2 / PERIOD * np.tan(w * PERIOD / 2)
    assert sampled(np.exp(1j * w * PERIOD)) == pytest.approx(F(1j * omega))
    again = bilinear_continuous(sampled)
    for name in "ABCD":
        np.testing.assert_allclose(getattr(again, name), getattr(F, name), atol=1e-12)
