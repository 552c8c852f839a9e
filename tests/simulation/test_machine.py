"""The compiled loop against the same arithmetic in plain Python, to the last bit."""

import math

import control
import numpy as np
import pytest

from workbench._core.compiled import compiled
from workbench.simulation import Cascade, Controller, Part, SampledLoop, adder, linear_controller

PERIOD, SAMPLES = 1e-3, 60
CHANNEL_LEVELS = np.array([[2.0**-8, -0.6, 0.6], [0.0, -0.5, 0.5], [1e-3, -0.04, 0.04]])
OUTPUT_LEVELS = np.array([[1e-2, -0.7, 0.69], [0.0, -0.4, 0.4]])


@compiled
def sense(position, exogenous, parameters, signals):
    signals[0] = math.sin(parameters[0] * (exogenous[0] - position[0]))
    signals[1] = exogenous[1] * position[1] + exogenous[0]


@compiled
def read(channels, parameters, measurement):
    measurement[0] = channels[0] - parameters[0] * channels[2]
    measurement[1] = channels[1] / (1.0 + abs(channels[2]))


@compiled
def both(state, parameters, given, told):
    """Keeps the first output until the input is large, so outputs must stay in the row."""
    state[0] += given[0]
    if abs(given[0]) > parameters[0]:
        told[0] = state[0]
    told[1] = given[0] - given[1]


def loop(delay, refine):
    rng = np.random.default_rng(3)
    a = np.array([[0, 1, 0, 0], [-4e4, -30, 9e3, 0], [0, 0, 0, 1], [8e3, 0, -9e4, -50]], float)
    c = np.vstack([np.eye(4)[[0, 2]], rng.normal(size=(1, 4)) * [1.0, 1e-3, 1.0, 1e-3]])
    plant = control.ss(a, 3e4 * rng.normal(size=(4, 2)) * [[0], [1], [0], [1]], c, 0.0)
    return SampledLoop(
        plant=plant,
        positions=2,
        sense=sense,
        sense_parameters=np.array([1.5]),
        signals=2,
        corner=900.0,
        read=read,
        read_parameters=np.array([0.3]),
        measurements=2,
        channel_levels=CHANNEL_LEVELS,
        output_levels=OUTPUT_LEVELS,
        dt=PERIOD,
        delay_samples=delay,
        refine=refine,
    )


def cascade():
    """Parts whose inputs are neighbours in the row, single, far apart, and repeated."""
    law = control.tf([0.6, 90.0], [1.0, 200.0])
    twice = Controller(both, np.zeros(1), np.array([0.1]), outputs=2, reads=2)
    return Cascade(
        ["e", "f"],
        [
            Part("both", twice, ["e", "f"], outputs=["held", "difference"]),
            Part("K", linear_controller(law, PERIOD), ["difference"]),
            Part("sum", adder(), ["u1", "K", "e", "e"]),
            Part(
                "out",
                Controller(both, np.zeros(1), np.array([0.05]), outputs=2),
                ["sum", "K"],
                outputs=["a", "b"],
            ),
        ],
        previous=["u1", "u2"],
    )


def convert(value, step, lowest, highest):
    if step > 0.0:
        value = step * math.floor(value / step + 0.5)
    if value < lowest - 0.5 * step:
        return lowest, 1
    return (highest, 1) if value > highest + 0.5 * step else (value, 0)


def dot(row, column, start=0.0):
    """Sum of products in the order of the entries."""
    for one, other in zip(row, column, strict=True):
        start += float(one) * float(other)
    return start


def plain(around, made, excitation, exogenous, noise):
    """Command, output, channels, measurement, position and saturated samples, one by one."""
    transition, drive, age, fraction, weights = around._advance
    C, levels = around.plant.C, (around.channel_levels, around.output_levels)
    x, at, filtered, start = np.zeros(4), [0.0, 0.0], np.zeros(2), np.zeros(2)
    sense(np.zeros(2), exogenous[0], around.sense_parameters, start)
    filtered[:] = start
    names, outputs = made.signals, np.zeros((0, 2))
    states = [np.array(part.controller.state) for part in made.parts]
    known = dict.fromkeys(names, 0.0)
    found, over = ([], [], [], [], []), [np.zeros(2, int), np.zeros(3, int)]
    for k in range(len(noise)):
        found[4].append(at)
        raw = [noise[k, 0] + filtered[0], noise[k, 1] + filtered[1], dot(C[2], x, noise[k, 2])]
        channels, many = zip(
            *(convert(r, *w) for r, w in zip(raw, levels[0], strict=True)), strict=True
        )
        over[1] += many
        measurement = np.zeros(2)
        read(np.array(channels), around.read_parameters, measurement)
        known |= dict(zip(made.measurements, measurement, strict=True))
        known |= dict(zip(made.previous, outputs[k - 1] if k else (0.0, 0.0), strict=True))
        for part, state in zip(made.parts, states, strict=True):
            told = np.array([known[name] for name in part.signals])
            given = np.array([known[name] for name in part.inputs])
            part.controller.step(state, part.controller.parameters, given, told)
            known |= dict(zip(part.signals, told, strict=True))
        command = np.array([known[name] for name in made.parts[-1].signals]) + excitation[k]
        output, many = zip(
            *(convert(r, *w) for r, w in zip(command, levels[1], strict=True)), strict=True
        )
        over[0] += many
        outputs = np.vstack([outputs, output])
        for one, value in zip(found, (command, output, channels, measurement), strict=False):
            one.append(value)
        for h in range(2 * len(age)):
            step, second = divmod(h, 2)
            held = k - age[step]
            moved = [
                dot(drive[step, i], outputs[held], dot(transition[step, i], x))
                if held >= 0
                else dot(transition[step, i], x)
                for i in range(8)
            ]
            outside = exogenous[k] + fraction[h] * (exogenous[k + 1] - exogenous[k])
            signals = np.zeros(2)
            sense(
                np.array(moved[2 * second : 2 * second + 2]),
                outside,
                around.sense_parameters,
                signals,
            )
            if not second:
                middle = signals
            else:
                w = weights[step]
                filtered = w[0] * filtered + (w[1] * start + w[2] * middle) + w[3] * signals
                start, at, x = signals, moved[2:4], np.array(moved[4:])
    return [np.array(one) for one in found] + over


@pytest.mark.parametrize(("delay", "refine"), [(0.0, 1), (1.0, 1), (1.4, 2)])
def test_every_signal_is_that_of_plain_arithmetic(delay, refine):
    rng, around, made = np.random.default_rng(0), loop(delay, refine), cascade()
    excitation = 0.3 * rng.normal(size=(SAMPLES, 2))
    exogenous = np.cumsum(0.2 * rng.normal(size=(SAMPLES + 1, 2)), axis=0)
    noise = 0.02 * rng.normal(size=(SAMPLES, 3))
    trajectory = around.run(made, excitation, exogenous, noise)
    expected = plain(around, made, excitation, exogenous, noise)
    assert all(np.count_nonzero(count) for count in expected[5:])
    for name, found, wanted in zip(trajectory._fields, trajectory, expected, strict=False):
        np.testing.assert_array_equal(found, wanted, err_msg=name)
    np.testing.assert_array_equal(trajectory.signals["u1"][1:], trajectory.output[:-1, 0])
    np.testing.assert_array_equal(
        trajectory.signals["a"] + excitation[:, 0], trajectory.command[:, 0]
    )
    stage = (SAMPLES // 2) * PERIOD
    switched = around.run([(0.0, made), (stage, cascade())], excitation, exogenous, noise)
    np.testing.assert_array_equal(switched.channels[:30], trajectory.channels[:30])
    np.testing.assert_array_equal(switched.measurement[:30], trajectory.measurement[:30])
