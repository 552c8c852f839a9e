"""Matched poles and zeros, and ways back to continuous time, against 50 digits and round trips."""

import control
import flint
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.synthesis import continuous_controller, discretise

tf = control.tf
T = 0.1
SYSTEMS = {
    "lag": tf([3.0], [1.0, 2.0]),
    "lead": tf([1.0, 2.0], [1.0, 20.0]),
    "PID with a filter": tf([2.0, 1.0], [0.05, 1.0]) + tf([1.0], [1.0, 0.0]),
    "integrator": tf([2.0], [1.0, 0.0]),
    "double integrator": tf([2.0], [1.0, 0.0, 0.0]),
    "differentiator with a lag": tf([1.0, 0.0], [1.0, 5.0]),
    "resonance": tf([1.0], [1.0, 0.02, 4.0]),
    "notch times lag": tf([1.0, 0.2, 9.0], [1.0, 3.0, 9.0]) * tf([1.0], [1.0, 1.0]),
    "unstable": tf([1.0, 3.0], [1.0, 1.0, -2.0]),
    "zero right of the axis": tf([-1.0, 3.0], [1.0, 4.0, 5.0]),
    "three lags and a zero": tf([1.0, 7.0], np.poly([-1.0, -2.0, -3.0])),
    "one zero, two pairs": tf(
        np.poly([-1.0, -0.2 + 2j, -0.2 - 2j]), np.poly([-3, -4, -1 + 1j, -1 - 1j])
    ),
    "gain": tf([2.0], [1.0]),
}


def responses(system, omega):
    points = np.exp(1j * omega * system.dt) if system.dt else 1j * omega
    return np.array([complex(system(s)) for s in points])


def by_hand(zeros, poles, k, omega):
    """The matched response from zeros, poles and gain, in 50 digits."""
    with flint.ctx.workdps(50):
        exp = lambda s: (flint.acb(complex(s)) * T).exp()  # noqa: E731
        ends = [exp(s) for s in zeros] + [flint.acb(-1)] * max(len(poles) - len(zeros) - 1, 0)
        starts = [exp(s) for s in poles]
        own = other = flint.acb(1)
        for s, sign in [(s, 1) for s in zeros] + [(s, -1) for s in poles]:
            own *= (flint.acb(complex(-s)) if s else flint.acb(1)) ** sign
        for z, sign in [(z, 1) for z in ends] + [(z, -1) for z in starts]:
            away = 1 - z
            other *= (flint.acb(T) if abs(away) < 1e-30 else away) ** sign
        found = []
        for w in omega:
            z = (flint.acb(0, float(w)) * T).exp()
            value = flint.acb(k) * own / other
            for each in ends:
                value *= z - each
            for each in starts:
                value /= z - each
            found.append(complex(value))
    return np.array(found)


ZPK = [
    ([], [-2.0], 3.0),
    ([-2.0], [-20.0], 1.5),
    ([], [0.0], 2.0),
    ([], [0.0, 0.0], 2.0),
    ([0.0], [-5.0], 1.0),
    ([], [-0.01 + 2j, -0.01 - 2j], 4.0),
    ([-7.0], [-1.0, -2.0, -3.0], 1.0),
    ([3.0], [-2 + 1j, -2 - 1j], -1.0),
    ([-0.2 + 2j, -0.2 - 2j, -1.0], [-3.0, -4.0, -1 + 1j, -1 - 1j], 0.7),
    ([], [-1e-5, -1.0], 1.0),
]


@pytest.mark.parametrize(("zeros", "poles", "k"), ZPK)
def test_matched_poles_zeros_and_gain(zeros, poles, k):
    K = control.ss(control.zpk(zeros, poles, k))
    found = discretise(control.zpk(zeros, poles, k), T, method="matched")
    assert found.nstates == K.nstates and found.dt == T
    omega = np.geomspace(0.01, 30.0, 20)
    assert responses(found, omega) == pytest.approx(by_hand(zeros, poles, k, omega), rel=1e-7)


@pytest.mark.parametrize("method", ["zoh", "tustin", "matched"])
@pytest.mark.parametrize("name", SYSTEMS)
def test_there_and_back(name, method):
    system = SYSTEMS[name]
    back = continuous_controller(discretise(system, T, method=method), method=method)
    omega = np.geomspace(0.01, 30.0, 25)
    assert back.dt == 0.0
    assert responses(back, omega) == pytest.approx(responses(system, omega), rel=1e-6)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
@pytest.mark.parametrize("method", ["zoh", "tustin", "matched"])
def test_in_other_units(unit, method):
    system = tf([3.0 * unit, unit**2], [1.0, 2.0 * unit, 4.0 * unit**2])
    back = continuous_controller(discretise(system, T / unit, method=method), method=method)
    omega = unit * np.geomspace(0.01, 30.0, 15)
    assert responses(back, omega) == pytest.approx(responses(system, omega), rel=1e-7)


@settings(max_examples=30, deadline=None)
@given(st.floats(-5.0, 2.0), st.floats(-5.0, -0.01), st.floats(0.1, 20.0), st.floats(-4.0, 4.0))
def test_random_systems_under_a_hold(pole, damping, turn, gain):
    den = np.polymul([1.0, -pole], [1.0, -2.0 * damping, damping**2 + turn**2])
    system = tf([gain, 1.0], den)
    back = continuous_controller(discretise(system, T, method="zoh"), method="zoh")
    omega = np.geomspace(0.1, 20.0, 10)
    scale = abs(responses(system, omega)).max()
    assert responses(back, omega) == pytest.approx(responses(system, omega), abs=1e-6 * scale)


def test_several_inputs_under_a_hold():
    A = np.array([[-1.0, 2.0, 0.0], [-2.0, -1.0, 1.0], [0.0, 0.0, 0.0]])
    system = control.ss(A, [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], np.eye(3), 0.0, inputs=["a", "b"])
    back = continuous_controller(discretise(system, T, method="zoh"), method="zoh")
    assert back.input_labels == ["a", "b"]
    for s in (0.3 + 1j, 5j):
        np.testing.assert_allclose(back(s), system(s), rtol=1e-9, atol=1e-12)


def test_a_pole_at_exactly_zero_frequency_stays():
    back = continuous_controller(
        discretise(SYSTEMS["integrator"], T, method="matched"), method="matched"
    )
    assert back.poles().tolist() == [0.0]
    assert abs(discretise(SYSTEMS["integrator"], T, method="matched").poles()[0]) == 1.0


@pytest.mark.parametrize(
    ("system", "method", "message"),
    [
        (tf([1.0], [1.0, 0.0], 0.1), "zoh", "pole at z = 0, as a delay has"),
        (tf([1.0], [1.0, 0.0, 0.0], 0.1), "matched", "pole at z = 0, as a delay has"),
        (tf([1.0], [1.0, 0.5], 0.1), "zoh", "pole z = -0.5, left of 0 on the real axis"),
        (tf([1.0], [1.0, 1.0, 0.25], 0.1), "matched", "left of 0 on the real axis"),
        (tf([1.0, 0.5], [1.0, -0.5], 0.1), "matched", "zero z = -0.5, at or left of 0"),
        (tf([1.0, 0.0], [1.0, -0.5], 0.1), "matched", "zero z = 0, at or left of 0"),
        (tf([1.0], [1.0, 1.0], 0.1), "tustin", "pole at z = -1"),
        (tf([1.0], [1.0, 1.0]), "zoh", "continuous already"),
        (tf([1.0], [1.0, -0.5], True), "zoh", "sampling time is not given"),
        (tf([1.0], [1.0, -0.5], 0.1), "foh", "method is 'foh'"),
        (control.ss(0.5 * np.eye(2), np.eye(2), np.eye(2), 0.0, 0.1), "matched", "2 inputs and 2"),
    ],
)
def test_what_has_no_continuous_system_is_named(system, method, message):
    with pytest.raises(InputError, match=message):
        continuous_controller(system, method=method)


def test_matched_belongs_to_one_input_and_output():
    with pytest.raises(InputError, match='2 inputs and 2 outputs; "matched" belongs to one'):
        discretise(control.ss(-np.eye(2), np.eye(2), np.eye(2), 0.0), T, method="matched")
    with pytest.raises(InputError, match="prewarp belongs to the bilinear transform"):
        discretise(SYSTEMS["lag"], T, method="matched", prewarp=1.0)
