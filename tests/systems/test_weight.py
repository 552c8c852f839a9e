"""Weights from three numbers, against what they are asked for."""

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import workbench as wb
from workbench.errors import InputError
from workbench.synthesis import weight

LOW, HIGH = st.floats(1e-6, 0.99), st.floats(1.01, 1e6)


def gain(system, omega):
    z = np.exp(1j * omega * system.dt) if system.dt else 1j * omega
    return float(abs(system(z)))


@settings(max_examples=60, deadline=None)
@given(LOW, HIGH, st.booleans(), st.integers(1, 4), st.floats(-9, 9), st.sampled_from([0, 0.1, 2]))
def test_the_three_gains(low, high, falls, order, decade, relative):
    dc, top = (high, low) if falls else (low, high)
    crossover = 10.0**decade
    dt = relative / crossover
    found = weight(dc=dc, crossover=crossover, high=top, order=order, dt=dt)
    end = math.pi / dt if dt else 1e12 * crossover
    # A gain is a sum with the larger one, whose rounding it has; slow sampled poles lie near 1.
    rounding = 1e-13 * order * max(dc, top)
    assert gain(found, 0.0) == pytest.approx(dc, rel=1e-6 if dt else 1e-12, abs=rounding)
    assert gain(found, crossover) == pytest.approx(1.0, rel=1e-9 if dt else 1e-12, abs=rounding)
    assert gain(found, end) == pytest.approx(top, rel=1e-6, abs=rounding)
    assert found.nstates == order and found.dt == dt
    poles = found.poles()
    assert (np.abs(poles) < 1.0 if dt else poles.real < 0.0).all()
    omega = np.geomspace(crossover * 1e-3, math.pi / dt if dt else crossover * 1e3, 50)
    steps = np.diff(np.log([gain(found, each) for each in omega]))
    assert (steps <= 1e-9).all() if falls else (steps >= -1e-9).all()


def test_an_integrator_and_a_roll_off():
    integrating = weight(dc=math.inf, crossover=3.0, high=0.5)
    assert integrating.poles().tolist() == [0.0] and gain(integrating, 3.0) == pytest.approx(1.0)
    assert float(integrating.D[0, 0]) == 0.5
    rolling = weight(dc=10.0, crossover=3.0, high=0.0, order=2)
    assert gain(rolling, 300.0) == pytest.approx(10.0 / (9e4 + 1.0)) and not rolling.D.any()
    assert weight(dc=math.inf, crossover=3.0, high=0.5, dt=0.1).poles().tolist() == [1.0]


@pytest.mark.parametrize("unit", [1e-100, 1e100])
def test_units_of_time_and_of_gain(unit):
    found = weight(dc=1e150, crossover=unit, high=1e-150)
    assert gain(found, 0.0) == pytest.approx(1e150) and gain(found, unit) == pytest.approx(1.0)


def test_it_weighs_a_synthesis():
    W = weight(dc=100.0, crossover=1.0, high=0.5)
    task = wb.synthesis.MixedSensitivity(control.tf([1.0], [1.0, 1.0]), W_S=W, W_KS=0.1)
    assert wb.solve(task).certificate.holds


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"dc": 100.0, "high": 2.0}, "dc is 100 and high is 2; the gain is 1 at a crossover only"),
        ({"dc": 0.1, "high": 0.5}, "one of them is above 1 and the other below"),
        ({"dc": 1.0, "high": 0.5}, "dc is 1 and high is 0.5"),
        ({"dc": 0.1, "high": math.inf}, "high is inf.*improper"),
        ({"dc": -100.0, "high": 0.5}, "dc is -100.0; it must be a gain"),
        ({"dc": math.nan, "high": 0.5}, "dc is nan"),
        ({"dc": 100.0, "high": 0.5, "crossover": 0.0}, "crossover is 0.0"),
        ({"dc": 100.0, "high": 0.5, "order": 0}, "order is 0"),
        ({"dc": 100.0, "high": 0.5, "dt": 4.0}, r"below half the sampling rate, 0\.785398 rad/s"),
        ({"dc": 100.0, "high": 0.5, "dt": -1.0}, "dt is -1.0"),
    ],
)
def test_impossible_triples_are_named(given, message):
    with pytest.raises(InputError, match=message):
        weight(**{"crossover": 1.0} | given)
