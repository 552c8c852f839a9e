"""Repetitive control against its own equations and a loop simulated beside it."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.simulation import Repetitive, play, respond

PERIOD = 1e-3


def test_after_one_period_it_repeats_what_it_was_given():
    """At the rotation and its low harmonics the delay and the low-pass are one period together."""
    law = Repetitive(rotation_hz=4.9, dt=PERIOD, corner_hz=150.0)
    time = np.arange(1500) * PERIOD
    for harmonic in (1, 3):
        given = np.sin(2 * np.pi * harmonic * 4.9 * time)
        given[round(2 / 4.9 / PERIOD) :] = 0.0
        told = play(law.controller, given[:, None])[:, 0]
        assert abs(told[:200]).max() == 0.0  # D is a little less than 204 samples
        second = slice(round(1.1 / 4.9 / PERIOD), round(1.9 / 4.9 / PERIOD))
        np.testing.assert_allclose(told[second], given[second], atol=0.01 * harmonic**2)
        third = slice(round(2.1 / 4.9 / PERIOD), round(2.9 / 4.9 / PERIOD))
        expected = 2 * np.sin(2 * np.pi * harmonic * 4.9 * time[third])
        np.testing.assert_allclose(told[third], expected, atol=0.02 * harmonic**2)


def test_its_response_is_that_of_the_equation():
    law = Repetitive(rotation_hz=9.7, dt=PERIOD, corner_hz=120.0, gain=0.5)
    impulse = np.zeros((40_000, 1))
    impulse[0] = 1.0
    told = play(law.controller, impulse)[:, 0]
    z = 1.002 * np.exp(0.21j)  # outside the unit circle: the memory hardly fades by itself
    whole, rest = divmod(law.delay_samples, 1.0)
    late = (1 - rest) * z**-whole + rest * z ** -(whole + 1)
    Q = complex(law.lowpass(z))
    assert (told * z ** -np.arange(float(len(told)))).sum() == pytest.approx(
        0.5 * Q * late / (1 - Q * late), rel=1e-6
    )


def test_what_has_to_contract():
    loop = control.ss(0.9, 1.0, 0.3, 0.0, PERIOD)
    law = Repetitive(rotation_hz=20.0, dt=PERIOD, corner_hz=100.0, gain=0.8)
    z = np.exp(1j * np.linspace(0.01, 3.1, 50))
    L = loop(z)
    np.testing.assert_allclose(
        law.contraction(loop)(z), law.lowpass(z) * (1 - 0.8 * L / (1 + L)), rtol=1e-9
    )
    with pytest.raises(InputError, match=r"unstable: \|z\| = 1\.2"):
        law.contraction(control.ss(0.9, 1.0, -0.3, 0.0, PERIOD))


def test_a_periodic_disturbance_is_forgotten():
    """And not by the loop alone, whose error stays."""
    law = Repetitive(rotation_hz=10.0, dt=PERIOD, corner_hz=100.0)
    errors = []
    for gain in (0.0, 1.0):
        memory, parameters = law.controller.state.copy(), law.controller.parameters
        x, told = 0.0, np.zeros(1)
        for k in range(800):
            e = np.sin(2 * np.pi * 10.0 * k * PERIOD) - 0.3 * x
            law.controller.step(memory, parameters, np.array([e]), told)
            x = 0.9 * x + e + gain * told[0]
            errors.append(e)
    alone, learning = abs(np.reshape(errors, (2, 8, 100))).max(axis=2)
    assert alone[-1] > 0.2
    assert learning[-1] < 0.02 * alone[-1]


def test_refusals():
    with pytest.raises(InputError, match="rotation frequency is 0"):
        Repetitive(0.0, PERIOD, 200.0)
    with pytest.raises(InputError, match="gain above 0 and at most 1"):
        Repetitive(5.0, PERIOD, 200.0, gain=1.5)
    with pytest.raises(InputError, match="corner_hz is 600"):
        Repetitive(5.0, PERIOD, corner_hz=600.0)
    with pytest.raises(InputError, match="corner_hz is 3"):
        Repetitive(5.0, PERIOD, corner_hz=3.0)
    lowpass = Repetitive(5.0, PERIOD, 200.0).lowpass
    assert respond(lowpass, np.ones((2000, 1)))[-1, 0] == pytest.approx(1.0)
