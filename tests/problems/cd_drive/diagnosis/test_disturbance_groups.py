"""Groups of disturbances, and the forces that a drive makes itself."""

import numpy as np
import pytest
from workbench.plants.cd_drive.diagnosis.defect_kinds import voltage_of_force
from workbench.plants.cd_drive.diagnosis.disturbance_groups.pollution import SelfPollution
from workbench.plants.cd_drive.diagnosis.disturbance_groups.problem import (
    disturbance_groups,
)
from workbench.plants.cd_drive.diagnosis.disturbance_groups.runs import error_of_force
from workbench.plants.cd_drive.drive.plants import controller
from workbench.plants.cd_drive.laboratory.bench_setup import PERIOD, RATE, find_drive
from workbench.plants.cd_drive.laboratory.experiment import Laboratory

from workbench import solve
from workbench.errors import InputError
from workbench.simulation import linear_controller
from workbench.solvers import Options

TIME = np.arange(0.0, 0.2, 1e-4)


def test_a_jump_of_the_carriage_ends_as_the_spring_pulls():
    drive = find_drive("radial", "CD3")
    force = SelfPollution(jump=10e-6, jump_start=0.05).force("radial", drive, TIME, 5.5)
    series = drive.k1 * drive.k2 / (drive.k1 + drive.k2)
    assert force[TIME < 0.05] == pytest.approx(0.0)
    assert force[-1] == pytest.approx(10e-6 * series)
    assert force.max() > force[-1]  # the damper pulls while the carriage moves


def test_air_grows_with_the_square_of_the_rotation():
    drive = find_drive("focus", "CD3")
    slow, fast = (SelfPollution(air=1e-3).force("focus", drive, TIME, f) for f in (9.0, 90.0))
    assert abs(fast).max() == pytest.approx(100 * abs(slow).max(), rel=0.01)


def test_the_other_coil_pulls_at_the_rotation():
    """Far below its resonance its force is its spring's, times the share."""
    drive = find_drive("focus", "CD3")
    force = SelfPollution(coupled=0.1).force("focus", drive, np.arange(0.0, 20.0, 1e-2), 0.1)
    assert abs(force).max() == pytest.approx(
        0.1 * find_drive("radial", "nominal").k * 70e-6, rel=0.01
    )


def test_error_by_a_force_is_that_of_the_simulated_loop():
    frequency, bench = 100.0, Laboratory("focus", "CD2", noise=0.0, electronics=0.0, bits=None)
    time = np.arange(round(0.3 * RATE)) / RATE
    force = 1e-3 * np.sin(2 * np.pi * frequency * time)
    law = linear_controller(controller("focus"), PERIOD)
    record = bench.closed_loop(law, voltage_of_force(bench) * force)
    turns = record.x[-round(0.1 * RATE) :] * np.exp(
        -2j * np.pi * frequency * time[: round(0.1 * RATE)]
    )
    found = error_of_force("focus", "CD2", [frequency])[0]
    assert 2 * abs(turns.mean()) / 1e-3 == pytest.approx(found, rel=0.01)


def test_bad_input_is_refused():
    for wrong in (0.0, np.nan):
        with pytest.raises(InputError, match="jump_time"):
            SelfPollution(jump_time=wrong)


@pytest.mark.cases(0)
@pytest.mark.parametrize("axis", ["focus", pytest.param("radial", marks=pytest.mark.slow)])
def test_study(axis):
    """Another seed changes no verdict."""
    task = disturbance_groups(axis, draws=1)
    for seed in (0, 1):
        solution = solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        numbers = task.metrics(solution.answer)
        assert numbers["superposition_off_high"] < 0.05
        assert numbers["peak_self_pollution_low_um"] > 1e-3
        assert numbers["fast_over_audio_air"] > 100.0
    wrong = solution.answer.copy(deep=True)
    wrong["superposition_off"][...] = 0.2
    assert not task.certify(wrong, 1e-6).holds
