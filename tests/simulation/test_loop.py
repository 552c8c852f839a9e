"""The loop against linear references, with logic inside, and what it refuses."""

import control
import numpy as np
import pytest

from workbench._core.compiled import compiled
from workbench.errors import InputError
from workbench.simulation import (
    Controller,
    SampledLoop,
    linear_controller,
    respond,
    sampled_model,
    zero_controller,
)

PERIOD, CORNER = 1e-3, 800.0
WIDE = np.array([[0.0, -1e3, 1e3]])


@compiled
def difference(position, exogenous, parameters, signals):
    signals[0] = parameters[0] * (exogenous[0] - position[0])


@compiled
def as_is(channels, parameters, measurement):
    measurement[:] = channels


@compiled
def gives_nan(state, parameters, measurement, output):
    state[0] += 1.0
    output[0] = np.nan if state[0] > 3.0 else 0.0


@compiled
def bang_bang(state, parameters, measurement, output):
    """Relay with hysteresis: logic that no linear system has."""
    if abs(measurement[0]) > parameters[0]:
        state[0] = np.sign(measurement[0])
    output[0] = parameters[1] * state[0]


def mass():
    """Position and filtered velocity of a damped mass."""
    a = [[0.0, 1.0, 0.0], [-1e3, -15.0, 0.0], [0.0, 500.0, -500.0]]
    return control.ss(a, [[0.0], [1.0], [0.0]], [[1.0, 0, 0], [0, 0, 1.0]], 0.0)


def loop(**options):
    values = {
        "plant": mass(),
        "positions": 1,
        "sense": difference,
        "sense_parameters": np.array([2.0]),
        "signals": 1,
        "corner": CORNER,
        "read": as_is,
        "read_parameters": np.zeros(0),
        "measurements": 2,
        "channel_levels": np.repeat(WIDE, 2, axis=0),
        "output_levels": WIDE,
        "dt": PERIOD,
    }
    return SampledLoop(**values | options)


def run(around, controller, samples=300, excitation=None, reference=None):
    excitation = np.zeros((samples, 1)) if excitation is None else excitation
    reference = np.zeros((samples + 1, 1)) if reference is None else reference
    return around.run(controller, excitation, reference, np.zeros((samples, 2)))


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0, 1.7])
def test_open_loop_is_the_linear_system(delay):
    u = np.random.default_rng(0).standard_normal((300, 1))
    trajectory = run(loop(delay_samples=delay, refine=4), zero_controller(), excitation=u)
    optics = control.ss(-CORNER, CORNER, -2.0, 0.0) * mass()[0, 0]
    exact = respond(sampled_model(mass(), PERIOD, delay_samples=delay), u)
    rounding = 1e-9 * np.abs(exact).max(axis=0)  # some hundred samples of two ways to compute
    np.testing.assert_allclose(trajectory.position[:, 0], exact[:, 0], rtol=0, atol=rounding[0])
    np.testing.assert_allclose(trajectory.channels[:, 1], exact[:, 1], rtol=0, atol=rounding[1])
    seen = respond(sampled_model(optics, PERIOD, delay_samples=delay), u)[:, 0]
    size = abs(seen).max()
    np.testing.assert_allclose(trajectory.channels[:, 0], seen, rtol=0, atol=1e-5 * size)


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0])
def test_closed_loop_is_the_linear_loop(delay):
    """Every signal of the loop against the feedback connection made by python-control."""
    optics = control.ss(-CORNER, CORNER, -2.0, 0.0) * mass()[0, 0]
    law = control.tf([900.0, 9000.0], [1.0, 400.0])
    plant = sampled_model(optics, PERIOD, delay_samples=delay)
    discrete = control.sample_system(control.ss(law), PERIOD, "bilinear")
    closed = control.feedback(control.ss([], [], [], [[1.0]], PERIOD), discrete * plant, sign=1)
    assert abs(closed.poles()).max() < 1.0
    excitation = np.random.default_rng(0).standard_normal((300, 1))
    trajectory = run(
        loop(delay_samples=delay, refine=4), linear_controller(law, PERIOD), excitation=excitation
    )
    expected = respond(closed, excitation)
    np.testing.assert_allclose(trajectory.command, expected, atol=1e-4 * abs(expected).max())


def test_reference_is_interpolated_and_steps_refine():
    time = np.arange(301)[:, None] * PERIOD
    reference = np.sin(2 * np.pi * 20 * time)
    law = control.tf([900.0, 9000.0], [1.0, 400.0])
    coarse, fine, finest = (
        run(loop(refine=n), linear_controller(law, PERIOD), reference=reference) for n in (1, 2, 8)
    )
    errors = [abs(each.position - finest.position).max() for each in (coarse, fine)]
    assert errors[0] < 1e-5 * abs(finest.position).max()
    assert errors[1] < errors[0] / 4
    # A ramp is linear between samples: followed exactly, and filtered exactly.
    ramp = run(loop(), zero_controller(), reference=100.0 * time)
    lag = 100.0 * (time[:-1] - (1 - np.exp(-CORNER * time[:-1])) / CORNER)
    np.testing.assert_allclose(ramp.channels[:, :1], 2.0 * lag, atol=1e-9)


def test_logic_in_the_loop():
    relay = Controller(bang_bang, np.array([1.0]), np.array([1e-3, 2.0]))
    trajectory = run(loop(), relay, samples=2000)
    assert set(np.unique(trajectory.command)) == {-2.0, 2.0}
    assert 5 < np.count_nonzero(np.diff(trajectory.command[:, 0])) < 200
    assert relay.state.tolist() == [1.0]  # a run works on a copy


def test_converters_in_the_loop():
    levels = np.array([[0.5, -1.0, 0.5]])
    u = np.array([[0.2], [0.3], [0.8], [-1.6], [-0.9]])
    trajectory = run(loop(output_levels=levels), zero_controller(), samples=5, excitation=u)
    assert trajectory.output[:, 0].tolist() == [0.0, 0.5, 0.5, -1.0, -1.0]
    assert trajectory.saturated_outputs.tolist() == [2]
    assert trajectory.command.tolist() == u.tolist()


def test_linear_controller_of_several_inputs():
    system = control.ss([[0.5, 0.1], [0, 0.2]], np.eye(2), [[1.0, 2.0]], [[0.3, 0.4]], PERIOD)
    law = linear_controller(system, PERIOD, measurements=(2, 0))
    state, inputs, given = law.state.copy(), np.random.default_rng(0).normal(size=(30, 3)), []
    for row in inputs:
        output = np.zeros(1)
        law.step(state, law.parameters, row, output)
        given.append(output[0])
    expected = respond(system, inputs[:, [2, 0]])[:, 0]
    np.testing.assert_allclose(given, expected, atol=1e-14)


def test_refusals():
    gain = control.ss([], [], [], [[1.0]])
    with pytest.raises(InputError, match="feedthrough"):
        loop(plant=gain)
    with pytest.raises(InputError, match="refine"):
        loop(refine=0)
    with pytest.raises(InputError, match="channel_levels"):
        loop(channel_levels=WIDE)
    with pytest.raises(InputError, match="output_levels"):
        loop(output_levels=WIDE[0])
    with pytest.raises(InputError, match="not finite at sample 3 of 300"):
        run(loop(), Controller(gives_nan, np.zeros(1), np.zeros(0)))
    with pytest.raises(InputError, match="excitation has shape"):
        run(loop(), zero_controller(), excitation=np.zeros((5, 1)))
    with pytest.raises(InputError, match="first in row 2"):
        run(
            loop(),
            zero_controller(),
            samples=4,
            excitation=np.array([[0], [1], [np.nan], [np.nan]]),
        )
    with pytest.raises(InputError, match="2 controller outputs"):
        run(loop(), zero_controller(outputs=2))
    with pytest.raises(InputError, match="decorate it"):
        Controller(print, np.zeros(0), np.zeros(0))
    with pytest.raises(InputError, match="1 measurements for a controller of 2"):
        linear_controller(control.ss([], [], [], [[1.0, 2.0]]), PERIOD)
    with pytest.raises(InputError, match="the controller has dt = "):
        linear_controller(control.ss(0.5, 1.0, 1.0, 0.0, 2e-3), PERIOD)
