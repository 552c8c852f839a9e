"""The bilinear transform of systems: responses at warped frequencies, and back again."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
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


@pytest.mark.parametrize("unit", [1.0, 1e9])
def test_units_of_states_do_not_decide_whether_a_pole_is_at_half_the_sampling_rate(unit):
    S = np.diag([unit, 1.0, 1 / unit])
    A = np.array([[-1.0, 0.2, 0.0], [0.0, 0.3, 1.0], [0.0, 0.0, 0.5]])
    B, C = np.ones((3, 1)), np.ones((1, 3))
    with pytest.raises(InputError, match="z = -1"):
        bilinear_continuous(control.ss(S @ A / S.diagonal(), S @ B, C / S.diagonal(), 0.0, PERIOD))
    A[0, 0] = -0.999
    sampled = control.ss(S @ A / S.diagonal(), S @ B, C / S.diagonal(), 0.0, PERIOD)
    omega = 2 / PERIOD * np.tan(1.0 * PERIOD / 2)
    assert bilinear_continuous(sampled)(1j * omega) == pytest.approx(sampled(np.exp(1j * PERIOD)))
