"""The disc servo, which keeps the buffer filled."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from workbench.plants.cd_drive.operation.disc_servo import servo
from workbench.plants.cd_drive.operation.disc_servo.problem import DiscServoStudy
from workbench.plants.cd_drive.operation.disc_servo.runs import ENGAGED, TOLD, Turned
from workbench.plants.cd_drive.operation.disc_servo.servo import STEP, Spindle, played

from workbench import solve
from workbench.errors import InputError
from workbench.solvers import Options

FIRST, LAST = 0.023, 0.058


# --- the spindle ------------------------------------------------------------------------------


@pytest.mark.parametrize("mass", servo.MASSES)
def test_the_loop_is_that_of_motor_disc_and_buffer(mass):
    """Independent: torque, angular speed and data, integrated in other variables."""
    one, r = Spindle(mass, 1.25), 0.04
    assumed = Spindle(velocity=1.25)
    p, J, k, R = servo.RATE, one.inertia, servo.TORQUE_CONSTANT, servo.RESISTANCE
    steady = one.velocity / r

    def wave(t):
        """Change of the friction [N m]."""
        return 1e-5 * np.sin(9.0 * t)

    def motion(t, y):
        data, fill, omega = y
        off = omega * r / one.velocity - 1.0
        wanted = -(3 * p * off + 3 * p**2 * fill + p**3 * data)
        volts = wanted * assumed.inertia * one.velocity / r * R / k + k * steady
        torque = k * (volts - k * omega) / R - wave(t)
        return [fill, off, torque / J]

    time = np.arange(0.0, 3.0, STEP)
    found = solve_ivp(motion, (0.0, 3.0), [0.0, 0.0, steady], t_eval=time, rtol=1e-9, atol=1e-12)
    d = -r * wave(time + STEP / 2) / (J * one.velocity)
    fill = np.append(0.0, np.convolve(d, one.responses[0])[: len(time) - 1])
    assert fill == pytest.approx(found.y[1], abs=2e-3 * abs(fill).max())
    off = np.append(0.0, np.convolve(d, one.responses[1])[: len(time) - 1])
    speed = found.y[2] * r / one.velocity - 1.0
    assert off == pytest.approx(speed, abs=2e-3 * abs(off).max())


def test_the_bounds_are_attained_and_not_passed():
    one, r, rng = Spindle(14e-3, 1.2), LAST, np.random.default_rng(4)
    for n, bound in ((0, one.swing(r)), (1, one.deviation(r))):
        h = one.responses[n]
        worst = one.varied(r) * np.sign(h[::-1])
        assert np.convolve(worst, h)[: len(h)].max() == pytest.approx(bound, rel=2e-2)
        for block in (10, 100, 1000):
            d = np.repeat(rng.uniform(-1.0, 1.0, 8000 // block), block) * one.varied(r)
            assert abs(np.convolve(d, h)[: len(d)]).max() < bound


def test_a_heavy_disc_is_stable_and_settles():
    for mass in servo.MASSES:
        a, _ = Spindle(mass).loop
        assert np.linalg.eigvals(a).real.max() < -1.0
        assert abs(Spindle(mass).responses[:, -1]).max() < 1e-9


def test_a_played_disc_follows_the_spiral():
    one = Spindle()
    found = played(one, FIRST, 60.0, np.random.default_rng(0))
    read = 1.6e-6 * one.velocity * found.time[-1]  # area of the track that was read
    assert np.pi * (found.radius[-1] ** 2 - FIRST**2) == pytest.approx(read, rel=1e-9)
    assert abs(found.fill).max() < one.swing(found.radius[-1])
    assert abs(found.turn_change).max() < one.turn_change(found.radius[-1])
    assert found.rotation[-1] == pytest.approx(1.3 / (2 * np.pi * found.radius[-1]), rel=0.01)


def test_a_jump_takes_its_time():
    one = Spindle()
    assert one.least_seek(FIRST, LAST) == pytest.approx(one.least_seek(LAST, FIRST))
    turns = 1.3 / (2 * np.pi) * (1 / FIRST - 1 / LAST)
    assert one.least_seek(FIRST, LAST) == pytest.approx(
        one.inertia * 2 * np.pi * turns / servo.STALL_TORQUE
    )


@pytest.mark.parametrize("wrong", [{"mass": 0.0}, {"velocity": np.inf}, {"mass": -1.0}])
def test_impossible_discs_are_refused(wrong):
    with pytest.raises(InputError, match="positive"):
        Spindle(**wrong)


# --- strategies -------------------------------------------------------------------------------


def test_the_laboratory_turns_its_disc_as_the_servo_does():
    one = Turned("focus", "CD2", 0.038, 5)
    time = np.array([0.3, 0.8, 1.2])
    _, rotation = one.disc.turned(time)
    at = np.rint((time + 1.0) / STEP).astype(int)
    assert rotation == pytest.approx(one.ride.rotation[at], rel=2e-4)
    assert np.ptp(rotation) > 0.0


def test_what_strategies_are_told():
    one = Turned("radial", "CD2", 0.038, 5)
    assert one.told("first track") == pytest.approx(9.0, rel=1e-3)
    assert one.told("address") == pytest.approx(1.3 / (2 * np.pi * 0.038))
    _, now = one.disc.turned(np.array([ENGAGED]))
    assert one.told("last turn") == pytest.approx(float(now[0]), rel=0.01)


def test_a_wrong_rotation_costs_more_than_a_right_one():
    one = Turned("focus", "CD7", LAST, 3)
    for strategy in ("A", "B"):
        wrong, right = (one.met(strategy, how) for how in (TOLD[0], TOLD[-1]))
        assert right.excursion < wrong.excursion
        assert abs(right.wrong) < 0.01 < 1.0 < wrong.wrong


@pytest.mark.slow
@pytest.mark.cases(0)
def test_study():
    """Another seed changes no verdict."""
    task = DiscServoStudy(1)
    for seed in (0, 1):
        solution = solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        numbers = task.metrics(solution.answer)
        assert numbers["swing_most_sectors"] < 1.0 and numbers["deviation_most"] < 0.077
    wrong = solution.answer.copy(deep=True)
    wrong["whole_swing"][...] *= 3.0
    wrong["excursion"].loc[{"told": TOLD[-1]}] *= 100.0
    wrong["finer"][...] += 0.1
    failed = {one.name for one in task.certify(wrong, 1e-6).checks if not one.holds}
    assert {"whole disc", "half the step"} <= failed and len(failed) == 6
