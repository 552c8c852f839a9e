"""The mean of responses whose phases turn."""

import numpy as np
import pytest

from workbench.uncertainty.covers.nominal import mean_response


@pytest.mark.parametrize("turned", [1, 3])
def test_noise_at_a_notch_does_not_turn_the_mean_beyond_it(turned):
    omega = np.geomspace(1.0, 100.0, 200)
    s = 1j * omega[:, None]
    damping = np.full(6, 0.02)
    damping[:turned] *= -1  # these turn the other way, as noise makes a notch turn
    points = (s**2 / 100 + damping * s + 1) / (s + 1) ** 2
    mean = mean_response(points)
    far = omega > 20
    np.testing.assert_allclose(np.angle(mean[far] / points[far, -1]), 0.0, atol=0.15)


def test_a_resonance_that_spreads_turns_the_mean_once():
    s = 1j * np.geomspace(0.1, 10.0, 400)[:, None]
    mean = mean_response(1 / (s**2 + 0.02 * s + np.array([0.8, 1.0, 1.25])))
    phase = np.unwrap(np.angle(mean))
    assert np.diff(phase).max() < 1e-9 and phase[-1] == pytest.approx(-np.pi, abs=0.01)
