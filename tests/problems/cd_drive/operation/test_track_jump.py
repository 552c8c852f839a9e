"""The radial loop jumps tracks."""

import numpy as np
import pytest
from scipy.optimize import linprog
from workbench.plants.cd_drive.drive.disc import Disc
from workbench.plants.cd_drive.drive.photo_diodes import TRACK_PITCH
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.operation.track_jump.laws import (
    Jump,
    acceleration,
    holding_voltage,
)
from workbench.plants.cd_drive.operation.track_jump.optimal import FastestJump
from workbench.plants.cd_drive.operation.track_jump.problem import TrackJump
from workbench.plants.cd_drive.operation.track_jump.runs import LAWS, START, Setting, landed

from workbench import solve
from workbench.simulation import play
from workbench.solvers import Options

CENTRED = Setting(contrast=0.6, share=0.0)


def test_fastest_jump_by_another_solver():
    """A linear program finds a pulse of as many samples, and none of one less."""
    jump = FastestJump("nominal", 4, 10.0)
    pulse, direction = jump.fastest()
    A, B = jump.model

    def feasible(samples):
        ends = np.transpose(
            [np.linalg.matrix_power(A, samples - 1 - k) @ B for k in range(samples)]
        )
        found = linprog(np.zeros(samples), A_eq=ends, b_eq=jump.target[0], bounds=(-10.0, 10.0))
        return found.status == 0

    assert feasible(len(pulse)) and not feasible(len(pulse) - 1)
    assert jump.beyond(direction, len(pulse) - 1) > 0.0 > jump.beyond(direction, len(pulse) + 5)
    assert np.linalg.norm(jump.reached_by(pulse) - jump.target[0]) < 1e-6


def test_the_target_is_held_by_the_same_voltage_as_in_the_laws():
    assert FastestJump("nominal", 16, 3.0).target[1] == pytest.approx(holding_voltage(16), rel=2e-3)


def test_a_clocked_pulse_moves_a_free_mass_by_its_tracks():
    jump = Jump(5, 3.0, 0.0)
    pulse = jump.clocked()
    speed = np.cumsum(pulse / jump.volts) * acceleration(jump.volts) / 35e3
    assert abs(speed[-1]) < 1e-9
    assert speed.sum() / 35e3 == pytest.approx(5 * TRACK_PITCH, rel=0.05)


def test_the_counting_law_tells_the_brake_from_evenly_pushed_zeros():
    """Zeros of a mass that is pushed evenly, as the diodes would show them, with their delay."""
    tracks, needed = 16, 200.0  # samples that the half way takes
    time = np.arange(600) - 2.0
    passed = 0.5 * tracks * np.clip(time / needed, 0.0, None) ** 2
    error = -np.sin(2 * np.pi * passed)
    total = 1.0 + 0.3 * (1.0 - np.cos(2 * np.pi * passed))
    told = play(Jump(tracks, 3.0, 0.0).counted(1.3), np.column_stack([error, total]))
    kick = int((told[:, 1] == 3.0).sum())
    assert abs(kick - needed) <= 2.0
    assert (told[:, 1] == -3.0).sum() == kick
    assert (told[2 * kick + 1 :, 0] == 1.0).all()


def test_light_between_the_tracks_does_not_change_the_error():
    disc = Disc.along("radial", 20e-6, rotation=6.0, run_up=0.0)
    plain, lit = (Laboratory("radial", "CD3", contrast=one, noise=0.0) for one in (0.0, 0.6))
    first, second = (one.open_loop(np.zeros(2000), disc) for one in (plain, lit))
    assert np.ptp(second.sum) / first.sum.mean() == pytest.approx(0.6, abs=0.02)
    # Filters of both diodes follow a product, so the errors agree while tracks pass slowly.
    assert abs(first.f_en - second.f_en).max() < 0.02


@pytest.mark.parametrize("law", LAWS[:1])
@pytest.mark.parametrize("drive", ["CD1", "CD9"])
def test_one_track(law, drive):
    found = CENTRED.landing(Jump(1, 3.0, START), law, drive, 5, np.zeros(0))
    assert (found.off, found.held) == (0.0, 1.0) and found.time < 10e-3


def test_a_jump_that_never_starts_stays():
    record = CENTRED.record(Jump(1, 3.0, 1.0), LAWS[0], "CD1", 1, np.zeros(0))
    assert landed(record, Jump(1, 3.0, START)).off == -1.0


@pytest.mark.slow
@pytest.mark.cases(0)
def test_study():
    """Another seed changes no verdict."""
    task = TrackJump(0.6, 1)
    for seed in (0, 1):
        solution = solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        numbers = task.metrics(solution.answer)
        assert numbers["landed_error_alone_all_high"] < numbers["landed_fastest_all_low"]
        assert numbers["landed_too_fast_high"] < numbers["landed_one_track_low"]
    wrong = solution.answer.copy(deep=True)
    wrong["pulse"][...] *= 1.01
    wrong["samples"][...] += 3
    wrong["off"].loc[{"law": LAWS[0]}] = 1.0
    failed = {one.name for one in task.certify(wrong, 1e-6).checks if not one.holds}
    assert failed == {"fastest", "none is faster", "limit", "one track"}
