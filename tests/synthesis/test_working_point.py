"""The C code about its working point, closed around nonlinear heaters."""

from functools import cache

import control
import numpy as np
import pytest
from compiled_code import Compiled, needs_compiler
from heaters import REST, Heater

from workbench.solution import solve
from workbench.synthesis import Implementation, WorkingPoint
from workbench.synthesis.implementation.working_point.constant_signals import constant_signals
from workbench.uncertainty import UncertaintyModel

PERIOD, LIMITS = 1.0, (0.0, 100.0)
STEPS = (0.4, 1.0, 2.0, 4.0)
s = control.tf("s")
MODEL = UncertaintyModel(
    0.50 / (85 * s + 1) * (1 - 2 * s) / (1 + 2 * s) / (4 * s + 1),
    0.25 * (1 + 40 * s) / (1 + 4 * s),
)
PI = 6.0 * (1 + 1 / (60 * s))
LAG = 6.0 * (1 + 1 / (60 * s + 0.01))
POINT = WorkingPoint(REST, 50.0, u_unit="%", y_unit="degC")
MADE = {"float": {}, "double": {}, "fixed": {"full_scale": (20.0, 100.0)}}


def heaters(count=3):
    rng = np.random.default_rng(64)
    return [Heater(rng, PERIOD) for _ in range(count)]


@cache
def board(precision="float", K=PI, **more):
    given = {"limits": LIMITS, "working_point": POINT} | dict(MADE[precision]) | more
    done = solve(Implementation(MODEL, K, PERIOD, delay_samples=0.0, precision=precision, **given))
    assert done.certificate.holds, done.certificate
    return done


def closed(made, heater, setpoint, seconds, u=REST):
    """Temperatures and powers, from a start at rest."""
    made.take(heater.sensor, heater.sensor, u)
    found = []
    for k in range(int(seconds / PERIOD)):
        power = float(made.step(setpoint(k * PERIOD), heater.sensor)[0])
        found.append((heater.sensor, power))
        heater.step(min(max(power, 0.0), 100.0))
    return np.array(found).T


@pytest.mark.cases(0)
@needs_compiler
@pytest.mark.parametrize("precision", MADE)
def test_every_heater_reaches_its_set_point_without_bump_or_offset(precision, tmp_path):
    made = Compiled(board(precision).answer, tmp_path)
    for heater in heaters():
        for step in STEPS:
            heater.rest(REST)
            start = heater.sensor
            y, u = closed(made, heater, lambda t: start + step * (t >= 5.0), 900.0)  # noqa: B023
            assert np.abs(u[:5] - REST).max() < 1e-3  # no bump
            assert np.abs(y[-50:] - start - step).max() < 2e-3  # no offset
            assert u.max() > REST + 4 * step  # nor are deviations clipped
            assert u.min() > 0 and u.max() <= 100


@pytest.mark.cases(1)
@needs_compiler
@pytest.mark.parametrize("precision", MADE)
def test_limits_are_absolute_and_leave_no_windup(precision, tmp_path):
    made, heater = Compiled(board(precision).answer, tmp_path), heaters(1)[0]
    start = heater.sensor
    y, u = closed(made, heater, lambda t: start + (15.0 if t < 400 else 3.0), 1300.0)
    assert u.max() == pytest.approx(100.0, abs=1e-4)
    assert u.min() >= 0.0
    assert u[402] < 60.0  # it leaves the limit at once
    assert y[-100:] == pytest.approx(start + 3.0, abs=5e-3)


@needs_compiler
@pytest.mark.parametrize("precision", MADE)
def test_manual_to_automatic_without_a_bump_far_from_the_working_point(precision, tmp_path):
    made, heater = Compiled(board(precision).answer, tmp_path), heaters(1)[0]
    heater.rest(72.0)
    rest = heater.sensor
    y, u = closed(made, heater, lambda t: rest, 300.0, u=72.0)
    assert np.abs(u - 72.0).max() < 2e-2
    assert np.abs(y - rest).max() < 2e-3


@pytest.mark.cases(1)
@needs_compiler
@pytest.mark.parametrize("precision", MADE)
def test_a_rate_limit_is_kept(precision, tmp_path):
    made = Compiled(board(precision, rate_limit=0.5).answer, tmp_path)
    heater = heaters(1)[0]
    start = heater.sensor
    y, u = closed(made, heater, lambda t: start + 3.0 * (t > 3), 1200.0)
    assert np.abs(np.diff(np.r_[REST, u])).max() <= 0.5 * PERIOD * (1 + 1e-5)
    assert np.abs(np.diff(u)).max() > 0.49
    assert y[-100:] == pytest.approx(start + 3.0, abs=5e-3)


@pytest.mark.cases(0)
def test_the_certificate_says_what_constant_signals_do():
    exact = board()
    assert exact.metrics["static_error"] == 0.0
    told = " ".join(exact.task.facts(exact.answer))
    assert "no static error for every plant of the set" in told
    assert "up to 18.75 degC below and 18.75 degC above" in told  # 50 % at the least gain, 0.375
    leaky = board(K=LAG)
    own = float(np.real(leaky.answer.K(1.0)))
    wanted = 1 / (1 + 0.375 * own)
    assert leaky.metrics["static_error"] == pytest.approx(wanted, rel=1e-6)
    assert "the controller has no integrator" in " ".join(leaky.task.facts(leaky.answer))
    check = next(one for one in leaky.certificate.checks if one.name == "constant signals")
    assert check.value == pytest.approx(wanted, rel=1e-6)


@pytest.mark.cases(0)
def test_the_statement_on_integrating_plants_names_no_static_gain():
    made = board()
    model = UncertaintyModel(2 / (s * (4 * s + 1)), 0.1 * (1 + 4 * s) / (1 + s))
    told = constant_signals(model, made.answer.K, -1, made.task.actuator).words("mm")
    assert "no static error" in told and "every plant integrates" in told
    assert "mm" not in told and "inf" not in told


@pytest.mark.cases(0)
def test_absolute_signals_of_the_code_are_read_back():
    done = board(rate_limit=2.0)
    from workbench.second_opinion.implemented.c_header import absolute_signals_agree

    code, wanted = done.answer.code(), done.task._absolute()
    assert absolute_signals_agree(code, wanted, np.float32).holds
    for old, new in (("_rest[1] = {50.0f}", "_rest[1] = {49.0f}"), ("{100.0f}", "{90.0f}")):
        assert not absolute_signals_agree(code.replace(old, new), wanted, np.float32).holds
    assert not absolute_signals_agree(code, wanted | {"change": None}, np.float32).holds
    turned = Implementation(
        MODEL, -PI, PERIOD, delay_samples=0.0, precision="float", sign=1, working_point=POINT
    )
    assert solve(turned).certificate.holds  # whose first factor is negative


def test_the_comment_shows_how_to_call_it():
    code = board().answer.code()
    assert "controller_start(&state, r, y, u);    no bump" in code
    assert "u = 50 %, y = 50 degC" in code
    assert "read y; controller_step(&state, r, y, u); give u to the actuator" in code
    assert "controller_to_u(i, u)" in board("fixed").answer.code()
