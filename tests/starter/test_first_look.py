"""What is odd about responses is asked of lines that are known, and of no noise."""

import numpy as np

from workbench.starter.first_look import oddities
from workbench.uncertainty import Responses

OMEGA = np.geomspace(0.01, 10.0, 60)
FILES = ("one.csv", "two.csv", "three.csv")


def noisy(slope, deviation, seed=5):
    """Gains omega^slope of three plants, in noise whose deviation grows with frequency."""
    rng = np.random.default_rng(seed)
    gain = (OMEGA**slope)[:, None] * np.ones(3)
    variance = np.broadcast_to((deviation * OMEGA**2)[:, None] ** 2, gain.shape)
    noise = np.sqrt(variance / 2) * (rng.standard_normal((2, *gain.shape)).T @ [1, 1j]).T
    return Responses(omega=OMEGA, values=gain + noise, variance=variance, degrees=20)


def test_a_falling_gain_below_the_noise_is_not_odd():
    hidden = noisy(-2.0, 0.3)
    rising = np.polyfit(np.log(OMEGA[-20:]), np.log(np.abs(hidden.values[-20:, 0])), 1)[0]
    assert rising > 0.5  # the noise does rise
    assert oddities(hidden, FILES) == ()


def test_a_gain_that_rises_above_the_noise_is_asked_about():
    (said,) = oddities(noisy(1.0, 1e-3), FILES)
    assert "the gain rises with frequency at the end, as its power 1.0" in said


def test_responses_without_variance_are_taken_as_known():
    exact = Responses(omega=OMEGA, values=(1j * OMEGA)[:, None] * np.ones(3))
    assert "are input and output exchanged?" in oddities(exact, FILES)[0]
