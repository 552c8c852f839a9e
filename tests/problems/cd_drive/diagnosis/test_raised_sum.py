"""White dots and jumped tracks raise the sum."""

import numpy as np
import pytest
from workbench.plants.cd_drive.diagnosis.defect_kinds import KINDS, draw, white_dot
from workbench.plants.cd_drive.diagnosis.raised_sum.problem import RaisedSum
from workbench.plants.cd_drive.diagnosis.raised_sum.runs import focus_sum, jump
from workbench.plants.cd_drive.drive.disc import Defect, Disc
from workbench.plants.cd_drive.drive.photo_diodes import TRACK_PITCH

from workbench import solve
from workbench.errors import InputError
from workbench.solvers import Options

LIGHT = 0.6 - 0.2 * np.cos(2 * np.pi * np.linspace(-0.5, 0.5, 65))
"""Light over a mirror's: 0.4 on the track, 0.8 between two."""


def test_a_white_dot_adds_light():
    rng = np.random.default_rng(0)
    dots = [white_dot(rng, 2.0) for _ in range(50)]
    assert all(-1.0 <= dot.depth <= -0.3 for dot in dots)
    time = np.linspace(0.0, 0.1, 5000)
    dot = Defect(length=0.4e-3, angle=0.1, depth=-0.5)
    light, _ = Disc(rotation=5.0).surface([dot], time)
    assert light.max() == pytest.approx(1.5, abs=1e-3)
    assert light.min() == 1.0
    with pytest.raises(InputError, match="-9 to 1"):
        Defect(depth=-9.5)


def test_white_dots_leave_the_other_draws_alone():
    assert "white dot" not in KINDS
    with pytest.raises(InputError, match="known"):
        draw("white dot", np.random.default_rng(0), "focus")


def test_sum_of_a_slow_passage_is_the_light_at_each_place():
    error = np.linspace(0.0, 2.0, 4001) * TRACK_PITCH
    found = focus_sum(error, LIGHT)
    expected = (0.6 - 0.2 * np.cos(2 * np.pi * error / TRACK_PITCH)) / 0.4
    assert found[50:] == pytest.approx(expected[50:], abs=0.02)


def test_sum_of_a_fast_passage_is_the_mean_light():
    """The filter of 8 kHz does not follow 100 tracks in a millisecond."""
    error = np.linspace(0.0, 300.0, 106) * TRACK_PITCH
    assert focus_sum(error, LIGHT)[20:] == pytest.approx(1.5, abs=0.1)


def test_a_shock_that_is_stood_passes_no_track():
    stood, jumped = (jump("CD1", 1, LIGHT, jumping) for jumping in (False, True))
    assert stood.tracks < 0.5 and np.isnan(stood.mean) and stood.most < 1.2
    assert jumped.tracks > 1.0 and jumped.most > 1.8


@pytest.mark.cases(0)
def test_study():
    """Another seed changes no verdict."""
    task = RaisedSum(LIGHT, 1)
    for seed in (0, 1):
        solution = solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        numbers = task.metrics(solution.answer)
        assert numbers["sum_white_dot_low"] > 1.2 > 0.8 > numbers["sum_scratch_high"]
        assert numbers["sum_most_jumping_low"] > 1.5 > numbers["sum_most_stood_high"]
    wrong = solution.answer.copy(deep=True)
    wrong["raised"][...] = 0.9
    assert not task.certify(wrong, 1e-6).holds
