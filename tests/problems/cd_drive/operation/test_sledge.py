"""The sledge that carries the pickup."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from workbench.plants.cd_drive.drive.actuator import specific_model
from workbench.plants.cd_drive.laboratory.bench_setup import (
    PERIOD,
    RATE,
    coil_gain,
    find_drive,
)
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.operation.sledge import bounds, train
from workbench.plants.cd_drive.operation.sledge.bounds import moved_loop
from workbench.plants.cd_drive.operation.sledge.carriage import (
    CarriedBench,
    carried_lens,
    law_beside,
)
from workbench.plants.cd_drive.operation.sledge.problem import RODS, SledgeStudy
from workbench.plants.cd_drive.operation.sledge.runs import QUIET, Ridden, Ride, largest_error
from workbench.plants.cd_drive.operation.sledge.train import Sledge, moved

from workbench import solve
from workbench.errors import InputError
from workbench.simulation import play
from workbench.solvers import Options

AXES = ["focus", "radial"]


# --- the lens on its carriage -----------------------------------------------------------------


@pytest.mark.parametrize("axis", AXES)
def test_a_lens_on_a_carriage_at_rest_is_that_of_the_laboratory(axis):
    omega = 2 * np.pi * np.geomspace(5.0, 5e3, 30)
    drive = find_drive(axis, "CD9")
    found = carried_lens(axis, "CD9")[0, 0](1j * omega)
    alone = coil_gain(drive) * specific_model(drive).response(omega / (2 * np.pi))
    assert found == pytest.approx(alone, rel=1e-8)


@pytest.mark.parametrize("axis", AXES)
def test_a_moving_carriage_pulls_by_springs_dampers_and_back_emf(axis):
    """The same lens by other equations: absolute places, the carriage pulls at its suspension."""
    drive, s = find_drive(axis, "CD3"), 2j * np.pi * np.array([3.0, 40.0, 55.0, 300.0, 900.0])
    one = specific_model(drive)
    emf = float(one.Bl**2 / one.R)
    for at, found in zip(s, carried_lens(axis, "CD3")[0, 1](s), strict=True):
        left = at**2 * one.M + at * one.C + one.K + at * emf * np.diag([1.0, 0.0])
        pull = [at * emf, at * drive.b1 + drive.k1]
        place = np.linalg.solve(left, pull)[0]
        assert found * at == pytest.approx(place, rel=1e-7)


@pytest.mark.parametrize("axis", AXES)
def test_on_a_carriage_at_rest_the_loop_runs_as_in_the_laboratory(axis):
    track = 2e-8 * np.sin(2 * np.pi * 50.0 * np.arange(3501) / RATE)
    bench = CarriedBench(axis, "CD2", **QUIET)
    found = bench.run(law_beside(axis), track)
    alone = moved_loop(axis, "CD2")
    z = np.exp(2j * np.pi * 50.0 * PERIOD)
    read = complex(Laboratory(axis, "CD2").sampled_error()(z))
    assert complex(alone._open(z)[0, 0]) == pytest.approx(read, rel=1e-7)
    error = alone.disc_error(1.0, 50.0) * 2e-8 / {"focus": 500e-6, "radial": 70e-6}[axis]
    assert abs(found.error[-1400:]).max() == pytest.approx(error, rel=5e-3)


# --- friction ---------------------------------------------------------------------------------


def test_friction_holds_at_rest_and_stops_what_moves():
    rods = np.array([0.05, 0.1, 0.07])
    assert moved(0.0, 0.09, PERIOD, rods) == 0.0
    assert moved(0.0, 0.11, PERIOD, rods) == pytest.approx(PERIOD / 0.05 * 0.04)
    assert moved(1e-6, -0.01, PERIOD, rods) == 0.0
    assert moved(-1.0, 0.0, PERIOD, rods) == pytest.approx(-1.0 + PERIOD / 0.05 * 0.07)


def test_a_slip_is_as_fast_as_the_equation_says():
    """Independent: the equation of motion from rest, by another integrator, without damper."""
    one = Sledge(rods=0.6, kinetic=0.6)
    k, m, motor = one.stiffness, one.mass, 2e-3

    def slipping(t, y):
        return [motor - y[1], (k * y[0] - one.kinetic * one.rods) / m]

    start = [one.rods / k, 0.0]
    found = solve_ivp(slipping, (0.0, 6e-3), start, rtol=1e-10, atol=1e-13, max_step=1e-5)
    assert found.y[1].max() == pytest.approx(one.slip_speed(motor), rel=1e-5)
    speed = one.slip_speed(motor)
    assert one.harmless_drop(speed, motor) == pytest.approx(one.drop, rel=1e-9)
    assert one.harmless_drop(1.9 * motor, motor) == 0.0


def test_the_motor_starts_at_its_starting_excursion():
    """Below it the sledge stands; above it the motor turns."""
    one = Sledge()
    volts = train.volts_per_metre("CD1") * one.start
    for factor, turns in ((0.98, False), (1.02, True)):
        told = play(one.servo("CD1"), np.full((35000, 1), factor * volts))
        assert bool(told[:, 1].any()) is turns
    assert one.starting_voltage * train.TORQUE_CONSTANT / train.RESISTANCE < train.STALL_TORQUE


def test_the_motor_is_that_of_the_data_sheet():
    k, R = train.TORQUE_CONSTANT, train.RESISTANCE
    assert k * 3.0 / R == pytest.approx(train.STALL_TORQUE)
    assert R * 35e-3 + k * train.NO_LOAD_SPEED == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("name", "value"), [("mass", 0.0), ("rods", -0.1), ("lead", np.nan), ("stiffness", np.inf)]
)
def test_impossible_sledges_are_refused(name, value):
    with pytest.raises(InputError, match=name):
        Sledge(**{name: value})


# --- rides ------------------------------------------------------------------------------------


def test_the_sledge_follows_the_mean_of_the_lens():
    """It stands, moves once, and stands again with the lens on the other side of its middle."""
    found = Ride("CD5").record(**QUIET)
    first = np.flatnonzero(found.speed)[0] / RATE
    assert 0.6 < first < 0.9 and not found.speed[-5000:].any()
    excursion = found.lens - found.carriage
    assert excursion.max() == pytest.approx(150e-6, rel=0.05)
    assert abs(excursion[-1]) < 60e-6


def test_without_stiction_it_creeps_along():
    smooth, dirty = (
        Ridden.of(Ride("CD1", Sledge.with_rods(rods)).record(**QUIET)) for rods in (0.0, 1.0)
    )
    assert smooth.speed < 0.1e-3 and smooth.largest < 5e-9
    assert dirty.speed > 8e-3 and dirty.largest > 0.2e-6


def test_draws_of_a_ride_differ_by_their_seed_alone():
    one, same, other = (Ride.drawn("CD4", 0.2, 0.5, seed) for seed in (1, 1, 2))
    assert one == same != other
    assert Ride.drawn("CD4", 0.5, 0.5, 1).sledge.mass == one.sledge.mass
    assert Ride.drawn("CD4", 0.0, 0.5, 1).sledge == one.sledge.without_stiction


# --- bounds -----------------------------------------------------------------------------------


@pytest.mark.parametrize("axis", AXES)
def test_no_motion_passes_the_bound_and_one_attains_it(axis):
    loop = moved_loop(axis, "CD7")
    rng, small = np.random.default_rng(5), 0.02 * loop.kept_speed()
    reached = largest_error(axis, "CD7", loop.worst_motion(small))
    assert reached == pytest.approx(small * loop.error_per_speed, rel=2e-3)
    for block in (3, 30, 300):  # samples for which a random speed lasts
        speed = np.repeat(rng.uniform(-small, small, 4000 // block), block)
        assert largest_error(axis, "CD7", speed) < loop.bound(small)


def test_the_responses_of_the_loop_settle_to_their_sum_at_zero_frequency():
    """An independent number: the error at constant speed, by solving for the steady ramp."""
    loop = moved_loop("radial", "CD1")
    a, b, c = loop._closed
    n = len(a)
    # x' = A x + b ramps along the carriage's place: (A - 1) x1 = 0 and (A - 1) x0 = x1 - b
    ramp = np.linalg.svd(a - np.eye(n))[2][-1]
    left = np.linalg.svd((a - np.eye(n)).T)[2][-1]
    ramp *= (left @ b[:, 1]) / (left @ ramp)
    steady = np.linalg.lstsq(a - np.eye(n), ramp - b[:, 1], rcond=None)[0]
    place = (c[0] @ steady) - (c[0] @ ramp) * (left @ steady) / (left @ ramp)
    assert abs(place) == pytest.approx(abs(loop.per_speed.sum()), rel=1e-3)


def test_what_the_diodes_read_wrong():
    from workbench.plants.cd_drive.drive.photo_diodes import TRACK_PITCH

    error = np.linspace(0.0, 0.4e-6, 9)
    slope = TRACK_PITCH / (2 * np.pi)
    sine = error - slope * np.sin(error / slope)
    assert [bounds.read_wrong(one) for one in error] == pytest.approx(sine)


def test_the_bound_ends_at_the_acceptable_error():
    loop = moved_loop("radial", "CD11")
    kept = loop.kept_speed()
    assert loop.bound(0.999 * kept) == pytest.approx(0.2e-6, rel=5e-3)
    assert loop.bound(1.001 * kept) == np.inf
    other = loop.disc_error(0.5, 9.0)
    assert loop.kept_speed(other) < 0.5 * kept
    assert loop.kept_speed(1e-6) == 0.0


@pytest.mark.slow
@pytest.mark.cases(0)
def test_study():
    """Another seed changes no verdict."""
    task = SledgeStudy(2)
    for seed in (0, 1):
        solution = solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        numbers = task.metrics(solution.answer)
        assert numbers["lost_1000_mN_mean"] > 0.05 and numbers["outside_0_mN_mean"] <= 0.05
        assert numbers["lost_0_mN_mean"] <= 0.01
        assert numbers["felt_radial_1000_mN_over_acceptable"] > 1.0
    wrong = solution.answer.copy(deep=True)
    wrong["replayed"][...] *= 1.01
    wrong["replayed_whole"][...] *= 1.5
    wrong["misread"][...] *= 1.05
    wrong["kept_speed"].loc[{"share": 1.0}] += 1e-3
    wrong["quiet_speed"][...] *= 1.5
    wrong["finer"][...] *= 1.01
    wrong["largest"].loc[{"rods": RODS[0]}] = 1e-6
    failed = {one.name for one in task.certify(wrong, 1e-6).checks if not one.holds}
    expected = {"attained", "reading", "speeds", "kept", "slips", "smooth", "half the step"}
    assert failed >= expected
