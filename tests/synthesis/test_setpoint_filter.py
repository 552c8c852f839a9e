"""The filter of the set-points: its C code against Python, and the rule for its time constant."""

from itertools import pairwise

import control
import numpy as np
import pytest
from compiled_code import Compiled, needs_compiler
from hypothesis import given
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.second_opinion.implemented.c_header import setpoint_filter_agrees
from workbench.synthesis import Implementation, WorkingPoint, setpoint_time_constant
from workbench.synthesis.operation.setpoint_filter import RATIO, _peak
from workbench.uncertainty import Responses, UncertaintyModel

DT, TIME, REST = 0.05, 1.3, (50.0, 20.0)
PLANT = control.tf([1.0], [1.0, 0.6, 1.0])
K = control.tf([1.0, 0.5], [1.0, 0.0])
POINT = WorkingPoint(*REST, u_unit="%", y_unit="K")
MADE = {"float": {}, "double": {}, "fixed": {"full_scale": (20.0, 100.0)}}
NEAR = {"float": 1e-4, "double": 1e-11, "fixed": 1e-5}


def implementation(plant=PLANT, controller=K, **given):
    return Implementation(plant, controller, DT, **{"working_point": POINT} | given)


def made(**given):
    """The controller without the bounds of its loop, which take long."""
    return implementation(**given).coefficients("tustin")


def by_hand(board, r, y, u):
    """The controls for set-points and measurements (samples,), by a filter that moves itself."""
    A, B, C, D = (np.asarray(part) for part in (board.K.A, board.K.B, board.K.C, board.K.D))
    still = np.vstack([A - np.eye(len(A)), C])  # rests, and gives u
    x = np.linalg.lstsq(still, np.r_[np.zeros(len(A)), u - REST[0]])[0]
    filtered, found = y[0], []
    for wanted, measured in zip(r, y, strict=True):
        e = board.actuator.sign * (measured - filtered)
        found.append(REST[0] + (C @ x + D[0] * e).item())
        x = A @ x + B[:, 0] * e
        filtered += (1 - np.exp(-DT / TIME)) * (wanted - filtered)
    return np.array(found)


@needs_compiler
@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("precision", MADE)
def test_the_code_does_what_the_filter_and_the_controller_do(precision, sign, tmp_path):
    board = made(
        precision=precision, controller=-sign * K, sign=sign, setpoint_filter=TIME,
        **MADE[precision],
    )  # fmt: skip
    code, rng = Compiled(board, tmp_path), np.random.default_rng(6)
    r = REST[1] + np.repeat(rng.uniform(-4, 4, 6), 50)
    y = REST[1] + rng.uniform(-2, 2, r.size)
    code.take(r[0], y[0], 55.0)
    found = np.array([code.step(*pair)[0] for pair in zip(r, y, strict=True)])
    assert found[0] == pytest.approx(55.0, abs=NEAR[precision])  # no bump, whatever r is
    assert found == pytest.approx(by_hand(board, r, y, 55.0), abs=NEAR[precision] * 10)


@needs_compiler
@pytest.mark.parametrize("precision", MADE)
def test_before_a_start_the_filter_is_at_the_working_point(precision, tmp_path):
    code = Compiled(made(precision=precision, setpoint_filter=TIME, **MADE[precision]), tmp_path)
    assert code.step(REST[1] + 3.0, REST[1]) == pytest.approx(REST[0], abs=1e-4)


@needs_compiler
def test_a_slow_filter_in_single_precision_ends_at_the_set_point(tmp_path):
    """20 000 samples, where steps of the filter would be below the rounding of the set-point."""
    gain, far = control.ss([], [], [], [[2.0]]), WorkingPoint(50.0, 3000.0)
    board = made(controller=gain, precision="float", setpoint_filter=2e4 * DT, working_point=far)
    code = Compiled(board, tmp_path)
    code.take(3001.0, 3000.0, 50.0)
    for _ in range(300_000):
        u = code.step(3001.0, 3000.0)
    assert u == pytest.approx(52.0, abs=1e-5)


@needs_compiler
def test_every_set_point_has_its_own_filter(tmp_path):
    two = control.append(PLANT, PLANT)
    gains = control.ss([], [], [], np.eye(2))
    point, times = WorkingPoint([0.0, 0.0], [0.0, 0.0]), [0.5, 2.0]
    board = made(plant=two, controller=gains, working_point=point, setpoint_filter=times)
    code = Compiled(board, tmp_path)
    code.take([1.0, 1.0], [0.0, 0.0], [0.0, 0.0])
    found = [code.step([1.0, 1.0], [0.0, 0.0]) for _ in range(40)]
    wanted = 1 - np.exp(-np.outer(np.arange(40), DT / np.array(times)))
    assert np.array(found) == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("precision", MADE)
def test_another_filter_in_the_code_is_found(precision):
    board = made(precision=precision, setpoint_filter=TIME, **MADE[precision])
    text, decay = board.code(), np.exp(-DT / TIME)
    assert "a time constant of 1.3 s" in text
    assert setpoint_filter_agrees(text, [decay]).holds
    assert not setpoint_filter_agrees(text, [np.exp(-DT / 1.01 / TIME)]).holds
    assert not setpoint_filter_agrees(text, []).holds
    assert not setpoint_filter_agrees(made().code(), [decay]).holds
    assert board.operations == made(precision=precision, **MADE[precision]).operations + 1
    assert board.memory > made(precision=precision, **MADE[precision]).memory


@pytest.mark.parametrize("bad", [-1.0, 0.0, np.nan, np.inf, 0.01, 1e6, [1.0, 2.0], []])
def test_a_time_constant_that_does_not_fit_is_named(bad):
    with pytest.raises(InputError, match=r"setpoint_filter is .*from 0.05, the sampling time"):
        implementation(setpoint_filter=bad)


def test_a_filter_needs_set_points():
    with pytest.raises(InputError, match="setpoint_filter needs a working_point"):
        implementation(setpoint_filter=1.0, working_point=None)


# --- the rule for the time constant ---------------------------------------------------------------

OMEGA = np.geomspace(0.01, 10, 60)
POLE, GAINS = 0.5, (0.9, 1.0, 1.1)
UNSTABLE = Responses(omega=OMEGA, values=np.array([gain / (1j * OMEGA - POLE) for gain in GAINS]).T)
MODEL = UncertaintyModel(control.tf([1.0], [1.0, -POLE]), control.tf([0.15], [1.0]))
PI = control.tf([2.0, 1.0], [1.0, 0.0])


def overshoot(gain, time_constant, samples=600):
    """Of the loop around gain / (s - POLE), held, by its difference equations."""
    grows = np.exp(POLE * DT)
    x = y = filtered = error = integral = peak = 0.0
    for _ in range(samples):
        y, before = x, error
        error = filtered - y
        integral += 0.5 * DT * (error + before)  # of (2 s + 1) / s, by the bilinear transform
        x = grows * x + gain * (grows - 1) / POLE * (2 * error + integral)
        filtered += (1 - np.exp(-DT / time_constant)) * (1 - filtered)
        peak = max(peak, y)
    return peak - 1


@pytest.mark.parametrize("most", [0.05, 0.2, 0.3])
def test_the_shortest_filter_that_limits_the_overshoot_is_found(most):
    found = setpoint_time_constant(UNSTABLE, implementation(MODEL, PI), most)
    assert max(overshoot(gain, 1e-9) for gain in GAINS) > 0.35  # of the loop by itself
    assert max(overshoot(gain, found) for gain in GAINS) < most * 1.02
    assert max(overshoot(gain, found / RATIO**3) for gain in GAINS) > most


def test_no_filter_where_none_is_needed_or_nothing_is_demanded():
    task = implementation(MODEL, PI)
    assert setpoint_time_constant(UNSTABLE, task, 0.99) is None
    assert setpoint_time_constant(UNSTABLE, task, None) is None


@given(st.integers(0, 2**32 - 1))
def test_a_longer_time_constant_never_raises_the_largest_value(seed):
    rng = np.random.default_rng(seed)
    steps = [np.r_[0.0, rng.standard_normal(50).cumsum()] for _ in range(2)]
    peaks = [_peak(steps, time, 1.0) for time in np.geomspace(1.0, 300.0, 12)]
    assert all(after <= before + 1e-12 for before, after in pairwise(peaks))


def test_misuse_of_the_rule_is_named():
    task = implementation(MODEL, PI)
    for bad in (-0.1, 1.0, np.nan, "10%"):
        with pytest.raises(InputError, match="overshoot is"):
            setpoint_time_constant(UNSTABLE, task, bad)
    with pytest.raises(InputError, match="implementation"):
        setpoint_time_constant(UNSTABLE, None, 0.1)
    weak = implementation(MODEL, control.tf([0.2, 0.1], [1.0, 0.0]))
    with pytest.raises(InputError, match=r"unstable around .*no filter of the set-point helps"):
        setpoint_time_constant(UNSTABLE, weak, 0.1)
    two = control.append(PLANT, PLANT)
    point = WorkingPoint([0.0, 0.0], [0.0, 0.0])
    several = implementation(two, control.ss([], [], [], np.eye(2)), working_point=point)
    with pytest.raises(InputError, match="2 inputs and 2 outputs"):
        setpoint_time_constant(UNSTABLE, several, 0.1)
