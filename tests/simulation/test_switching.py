"""Blends, removal, false alarms and controllers that follow each other."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.simulation import (
    adder,
    blender,
    fault_subtractor,
    interval_gate,
    linear_controller,
    play,
    ramped_gain,
    tracking_controller,
)

PERIOD = 1e-3
PI = control.tf([5.0, 100.0], [1.0, 1e-3])
"""Nearly an integrator: left alone it would be anywhere."""


@settings(deadline=None, max_examples=30)
@given(st.floats(0, 1), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_arithmetic(w, a, b):
    assert play(blender(), [[w, a, b]])[0, 0] == pytest.approx(w * a + (1 - w) * b, abs=1e-9)
    assert play(blender(), [[w, a]])[0, 0] == pytest.approx(w * a, abs=1e-9)
    assert play(fault_subtractor(gain=3.0), [[w, a, b]])[0, 0] == pytest.approx(
        a - (1 - w) * 3 * b, abs=1e-9
    )
    assert play(adder(), [[w, a, b]])[0, 0] == pytest.approx(w + a + b, abs=1e-9)


@pytest.mark.parametrize(
    "part", [blender(), fault_subtractor(), tracking_controller(PI, PERIOD, 500.0)]
)
@pytest.mark.parametrize("w", [-0.1, 1.1])
def test_a_quality_that_is_none_is_reported(part, w):
    row = [0.0, w, 0.0] if part.outputs == 1 and len(part.state) else [w, 1.0, 1.0]
    with pytest.raises(InputError, match="not finite at sample 0"):
        play(part, [row])


def test_false_alarms():
    record = np.ones((100, 1))
    told = play(interval_gate([(0.010, 0.020), (0.05, 0.051)], PERIOD), record)[:, 0]
    assert np.flatnonzero(told == 0.0).tolist() == [*range(10, 20), 50]
    assert play(interval_gate([], PERIOD), record).all()
    for wrong in ([(0.2, 0.1)], [(0.0, 0.2), (0.1, 0.3)], [(0.0, np.nan)]):
        with pytest.raises(InputError, match="from < until"):
            interval_gate(wrong, PERIOD)


def test_one_in_charge_is_the_linear_controller():
    e = np.random.default_rng(0).standard_normal(200)
    record = np.column_stack([e, np.ones(200), np.full(200, 77.0)])
    expected = play(linear_controller(PI, PERIOD), e[:, None])
    np.testing.assert_allclose(
        play(tracking_controller(PI, PERIOD, 500.0), record), expected, atol=1e-12
    )
    record[:, 1] = 0.0
    np.testing.assert_allclose(
        play(tracking_controller(PI, PERIOD, 500.0, substitute=True), record), expected, atol=1e-12
    )


@pytest.mark.parametrize("law", [PI, PI * control.tf([200.0], [1.0, 200.0])])
def test_one_not_in_charge_comes_to_the_command_of_the_other(law):
    """And takes over from there without a bump, which it would not when left alone."""
    e = np.full(300, 0.1)
    v = np.full(300, 4.0)
    w = np.concatenate([np.zeros(200), np.ones(100)])
    told = play(tracking_controller(law, PERIOD, rate=200.0), np.column_stack([e, w, v]))[:, 0]
    jump = abs(np.diff(told))[199:205].max()
    assert abs(told[199] - 4.0) < 0.1
    assert jump < 0.1
    alone = play(linear_controller(law, PERIOD), e[:, None])[:, 0]
    assert abs(alone[199] - 4.0) > 1.0


def test_followers_that_cannot():
    with pytest.raises(InputError, match="rate is 0"):
        tracking_controller(PI, PERIOD, rate=0.0)
    with pytest.raises(InputError, match="2 inputs"):
        tracking_controller(control.ss([], [], [], [[1.0, 2.0]]), PERIOD, 500.0)
    hidden = control.ss(np.diag([0.999, 0.99]), [[1.0], [1.0]], [[1.0, 0.0]], 0.0, PERIOD)
    with pytest.raises(InputError, match="no observer"):
        tracking_controller(hidden, PERIOD, rate=200.0)


def test_a_ramp_starts_on_time_and_changes_by_its_rate():
    told = play(ramped_gain(20.0, 0.1, PERIOD), np.ones((round(1.1 / PERIOD) + 1, 1)))[:, 0]
    time = np.arange(len(told)) * PERIOD
    np.testing.assert_allclose(told, 10.0 ** np.maximum(time - 0.1, 0.0), rtol=1e-9)
    assert (play(ramped_gain(0.0, 0.0, PERIOD), np.ones((10, 1))) == 1.0).all()
    for wrong in ((np.nan, 0.0), (1.0, -0.1), (1.0, np.inf)):
        with pytest.raises(InputError, match="rate is"):
            ramped_gain(*wrong, PERIOD)
