"""Cascades of parts: against the linear loop, switched at a time, in plain Python, and refusals."""

import control
import numpy as np
import pytest

from workbench._core.compiled import compiled
from workbench.errors import InputError
from workbench.simulation import (
    Cascade,
    Controller,
    Part,
    SampledLoop,
    adder,
    blender,
    linear_controller,
)

PERIOD = 1e-3
WIDE = np.array([[0.0, -1e3, 1e3]])
LAW = control.tf([900.0, 9000.0], [1.0, 400.0])


@compiled
def difference(position, exogenous, parameters, signals):
    signals[0] = exogenous[0] - position[0]


@compiled
def as_is(channels, parameters, measurement):
    measurement[:] = channels


@compiled
def count(state, parameters, given, told):
    state[0] += 1.0
    told[0] = state[0]


@compiled
def fails_after(state, parameters, given, told):
    state[0] += 1.0
    told[0] = np.nan if state[0] > parameters[0] else 0.0


def loop():
    plant = control.ss([[0.0, 1.0], [-1e3, -15.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    return SampledLoop(
        plant=plant,
        positions=1,
        sense=difference,
        sense_parameters=np.zeros(0),
        signals=1,
        corner=800.0,
        read=as_is,
        read_parameters=np.zeros(0),
        measurements=1,
        channel_levels=WIDE,
        output_levels=WIDE,
        dt=PERIOD,
        delay_samples=1.0,
    )


def run(controller, samples=300):
    reference = np.sin(0.05 * np.arange(samples + 1))[:, None]
    return loop().run(controller, np.zeros((samples, 1)), reference, np.zeros((samples, 1)))


def law(name="K", given="e", outputs="u"):
    return Part(name, linear_controller(LAW, PERIOD), [given], outputs=[outputs])


@pytest.mark.cases(0)
def test_a_controller_in_two_parts_is_the_controller():
    first, second = control.tf([1.0], [1.0, 400.0]), control.tf([900.0, 9000.0], [1.0, 50.0])
    parts = [
        Part("first", linear_controller(first, PERIOD), ["e"]),
        Part("second", linear_controller(second, PERIOD), ["first"], outputs=["u"]),
    ]
    found = run(Cascade(["e"], parts))
    whole = linear_controller(
        control.ss(
            control.sample_system(control.ss(second), PERIOD, "bilinear")
            * control.sample_system(control.ss(first), PERIOD, "bilinear")
        ),
        PERIOD,
    )
    np.testing.assert_allclose(found.command, run(whole).command, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(found.signals["u"], found.command[:, 0])
    np.testing.assert_array_equal(found.signals["u_last"][1:], found.output[:-1, 0])


def test_a_part_keeps_its_state_when_the_cascade_is_switched():
    once, same = run(Cascade(["e"], [law()])), Cascade(["e"], [law()])
    switched = run([(0.0, Cascade(["e"], [law()])), (0.1, same)])
    np.testing.assert_array_equal(switched.command, once.command)
    fresh = run([(0.0, Cascade(["e"], [law()])), (0.1, Cascade(["e"], [law("other")]))])
    np.testing.assert_array_equal(fresh.command[:100], once.command[:100])
    assert abs(fresh.command - once.command).max() > 1e-3


def test_signals_of_a_stage_are_nan_outside_of_it():
    counter = Part("n", Controller(count, np.zeros(1), np.zeros(0)), [])
    told = run([(0.0, Cascade(["e"], [law()])), (0.1, Cascade(["e"], [counter, law()]))]).signals
    assert np.isnan(told["n"][:100]).all()
    np.testing.assert_array_equal(told["n"][100:], np.arange(1.0, 201.0))


def test_plain_python_gives_what_compiled_code_gives():
    parts = [
        Part("n", Controller(count.py_func, np.zeros(1), np.zeros(0), plain=True), []),
        law(),
    ]
    plain, fast = run(Cascade(["e"], parts)), run(Cascade(["e"], [law()]))
    np.testing.assert_array_equal(plain.command, fast.command)
    np.testing.assert_array_equal(plain.position, fast.position)
    np.testing.assert_array_equal(plain.signals["n"], np.arange(1.0, 301.0))


@pytest.mark.parametrize("plain", [False, True])
def test_a_part_that_fails_is_named_with_its_time(plain):
    step = fails_after.py_func if plain else fails_after
    part = Part("detector", Controller(step, np.zeros(1), np.array([7.0]), plain=plain), [])
    with pytest.raises(
        InputError, match=r"detector's output 'detector' .* sample 7 of 300, 0\.007 s"
    ):
        run(Cascade(["e"], [part, law()]))
    with pytest.raises(InputError, match=r"sample 107 of 300, 0\.107 s"):
        run([(0.0, Cascade(["e"], [law()])), (0.1, Cascade(["e"], [part, law()]))])


def test_refusals():
    with pytest.raises(InputError, match="two parts are called K"):
        Cascade(["e"], [law(), law(outputs="v")])
    with pytest.raises(InputError, match="two signals are called e"):
        Cascade(["e"], [law(outputs="e")])
    with pytest.raises(InputError, match="'K' reads f, which no part before it"):
        Cascade(["e"], [law(given="f")])
    with pytest.raises(InputError, match="without parts"):
        Cascade(["e"], [])
    with pytest.raises(InputError, match="its controller gives 1"):
        Part("K", linear_controller(LAW, PERIOD), ["e"], outputs=["u", "v"])
    with pytest.raises(InputError, match=r"dt = 0\.002 s, the loop dt = 0\.001 s"):
        run(Cascade(["e"], [Part("K", linear_controller(LAW, 2e-3), ["e"], outputs=["u"])]))
    with pytest.raises(InputError, match="a cascade of 2 measurements"):
        run(Cascade(["e", "f"], [law()]))
    one = Cascade(["e"], [law()])
    for times in ((0.1,), (0.0, 0.2, 0.1), (0.0, 0.3), ()):
        with pytest.raises(InputError, match="stages start at"):
            run([(time, one) for time in times])
    other = Cascade(["e"], [Part("K", blender(), ["e", "e"], outputs=["u"])])
    with pytest.raises(InputError, match="takes over 0 states"):
        run([(0.0, one), (0.1, other)])
    assert np.isfinite(
        run(Cascade(["e"], [Part("K", adder(), ["e", "e"], outputs=["u"])])).command
    ).all()
