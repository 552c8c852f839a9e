"""A loop is lost, and recovers."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.photo_diodes import TRACK_PITCH
from workbench.plants.cd_drive.operation.focus_search import Search, volts_per_metre
from workbench.plants.cd_drive.operation.recovery import causes
from workbench.plants.cd_drive.operation.recovery.problem import RecoveryStudy
from workbench.plants.cd_drive.operation.recovery.runs import Recovery, lit
from workbench.plants.cd_drive.operation.recovery.times import BLOCK, least_search, way_back

from workbench import solve
from workbench.errors import UnknownNameError
from workbench.simulation import play
from workbench.solvers import Options

PERIOD = 1 / 35e3


def test_a_search_begins_when_its_patience_ends():
    """It starts closed, stands a short darkness, and opens in a long one."""
    search = Search(speed=5e-3, light=1.0, patience=10.5 * PERIOD, closed=True)
    bright, dark = [0.0, 2.0], [0.0, 0.0]
    told = play(search.law, [bright] * 3 + [dark] * 10 + [bright] + [dark] * 40)
    closed = told[:, 0]
    assert closed[:24].all() and not closed[25:].any()
    assert (np.diff(told[25:, 1] / volts_per_metre()) < 0.0).all()  # the lens draws back


def test_a_closed_loop_without_patience_is_never_opened():
    told = play(Search(speed=5e-3, light=1.0, closed=True).law, [[0.0, 0.0]] * 1000)
    assert told[:, 0].all()


def test_the_error_is_left_out_in_the_dark():
    assert play(lit(1.0), [[2.0, 1.0], [0.5, 1.0], [2.0, 0.0]])[:, 0].tolist() == [1.0, 0.0, 0.0]
    assert play(lit(1.0), [[2.0], [0.5]])[:, 0].tolist() == [1.0, 0.0]


@pytest.mark.parametrize("cause", ["scratch", "burst", "dark patch"])
def test_a_defect_is_met_once_at_its_time(cause):
    disc = causes.disc("radial", np.random.default_rng(3))
    (spot,) = causes.defects("radial", cause, disc, 1e-6)
    time = np.arange(35000) * PERIOD
    light, _ = disc.surface([spot], time)
    met = time[light < 1.0]
    assert met.min() == pytest.approx(causes.AT, abs=2e-4)
    assert met.max() == pytest.approx(causes.ends(cause), abs=1e-3)


def test_patience_decides_about_a_burst():
    """The search that a burst starts costs its whole time; waiting costs nothing."""
    hasty, patient = (
        Recovery("focus", one, 5e-3).recovered("CD1", "burst", 1) for one in (0.5e-3, 5e-3)
    )
    assert (hasty.lost, hasty.searches) == (0.0, 1.0) and hasty.back > least_search("CD1", 5e-3)
    assert patient.searches == 0.0 and patient.back < 5e-3


def test_a_search_takes_its_least_time_and_little_more():
    found = Recovery("focus", 5e-3, 5e-3).recovered("CD8", "shock", 2)
    assert found.lost == 1.0
    assert 0.98 < (found.back - found.detected) / least_search("CD8", 5e-3) < 1.1


def test_a_weak_shock_loses_nothing_and_a_strong_one_the_track():
    weak, strong = (
        Recovery("radial", 0.0, 5e-3).recovered("CD3", one, 1) for one in ("weak shock", "shock")
    )
    assert (weak.lost, weak.away) == (0.0, 0.0)
    assert strong.lost == 1.0 and strong.back > causes.ends("shock") - causes.AT


def test_where_a_lost_track_ends_is_counted():
    recovery = Recovery("radial", 0.0, 5e-3)
    record = recovery.record("CD6", "shock", 4)
    found = recovery.recovered("CD6", "shock", 4)
    moved = float((record.x - record.x_cd)[-100:].mean()) / TRACK_PITCH
    assert found.away == round(moved) and abs(moved - found.away) < 0.1


def test_the_way_back_reads_the_place_before_every_jump():
    assert way_back("CD1", 0, 1) == 0.0
    one = way_back("CD1", -1, 1)
    assert BLOCK < one < 2 * BLOCK + 0.025
    assert way_back("CD1", 20, 2) > 2 * BLOCK  # two jumps, as zeros of a longer one are missed


def test_unknown_causes_are_named():
    with pytest.raises(UnknownNameError, match="shock"):
        causes.cause("thunder")


@pytest.mark.slow
@pytest.mark.cases(0)
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_study(axis):
    """Another seed changes no verdict."""
    task = RecoveryStudy(axis, 5e-3, 1)
    for seed in (0, 1):
        solution = solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        numbers = task.metrics(solution.answer)
        assert (numbers["back_after_losses_median_s"] > 0.3) is (axis == "focus")
    wrong = solution.answer.copy(deep=True)
    wrong["lost"].loc[{"cause": "weak shock"}] = 1.0
    wrong["back"][...] = np.nan
    wrong["least"][...] = 2.0
    failed = {one.name for one in task.certify(wrong, 1e-6).checks if not one.holds}
    assert failed >= {"weak shocks", "back"}
