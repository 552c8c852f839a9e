"""Signals of the five diodes over both errors, and what pits modulate of HF."""

import numpy as np
import pytest
from workbench.plants.cd_drive.coupling.bench import two_axis_diodes
from workbench.plants.cd_drive.coupling.diodes.light import (
    DIODES,
    SHARED,
    diffracted_ratio,
    diode_light,
    normalised_errors,
    sensor_parameters,
)
from workbench.plants.cd_drive.coupling.diodes.pits import modulation
from workbench.plants.cd_drive.coupling.diodes.problem import Diodes
from workbench.plants.cd_drive.drive.photo_diodes import TRACK_PITCH

from workbench import solve

ERRORS = np.array([-1e-6, 0.0, 1e-6])


def test_four_of_them_are_those_of_the_bench():
    parameters = sensor_parameters("CD3", "along")
    own = parameters[: SHARED + (len(parameters) - SHARED) // 2]
    seen, light = np.zeros(4), diode_light("CD3", "along", ERRORS, np.array([0.1e-6]), 0.7)
    for n, error in enumerate(ERRORS):
        two_axis_diodes(np.zeros(2), np.array([error, 0.1e-6]), own, seen)
        assert light[:4, n, 0] == pytest.approx(0.7 * seen, rel=1e-12)


def test_the_third_receives_as_much_on_a_track_and_across_it_everywhere():
    radial = TRACK_PITCH * np.array([0.0, 0.25])
    across, along = (_third_off(split, radial) for split in ("across", "along"))
    assert len(DIODES) == 5 and across.max() < 1e-12 > along[:, 0].max()
    assert 0.05 < along[1, 1] < 0.2


def _third_off(split, radial):
    """Relative distance (E, R) of D3 from D1 + D2."""
    d1, d2, _, _, d3 = diode_light("nominal", split, ERRORS, radial)
    return abs(d3 / (d1 + d2) - 1.0)


def test_the_halves_of_the_pupil_follow_diffraction():
    radial = TRACK_PITCH * np.array([-0.25, 0.1, 0.25])
    d1, d2, _, _, d3 = diode_light("nominal", "along", np.array([2e-6]), radial)
    exact = diffracted_ratio("along", 2e-6, radial)
    assert (d3 / (d1 + d2))[0] == pytest.approx(exact, abs=0.01)
    assert exact[0] * exact[2] == pytest.approx(1.0, abs=1e-9)  # both sides of the track mirror


def test_errors_that_are_normalised_do_not_know_the_reflection():
    bright, dim = (
        normalised_errors(diode_light("CD6", "along", ERRORS, np.array([0.1e-6]), light))
        for light in (1.0, 0.2)
    )
    for name in ("sum", "D3", "radial"):
        assert bright[name] == pytest.approx(dim[name], rel=1e-9)
    assert bright["none"] == pytest.approx(5 * dim["none"], rel=1e-9)


def test_the_shortest_pits_fade_first_and_none_is_seen_between_tracks():
    short, long = ([modulation(bits, x) for x in (0.0, 3e-6)] for bits in (3, 11))
    assert short[0][0] < long[0][0]
    assert short[1][0] / short[0][0] < long[1][0] / long[0][0] < 1.0
    assert short[0][1] < 0.2 * short[0][0]


def test_study():
    task = Diodes()
    solution = solve(task)
    assert solution.certificate.holds, solution.certificate
    numbers = task.metrics(solution.answer)
    assert numbers["D3_off_on_track_across"] < 1e-9 < numbers["D3_off_on_track_along"] < 0.1
    assert numbers["none_changes_by_reflection"] == pytest.approx(6.0)
    assert numbers["HF_over_focus_sum"] == pytest.approx(2.0, rel=1e-6)
    wrong = solution.answer.copy(deep=True)
    wrong["signal"].loc[{"diode": "D3", "split": "along"}] *= 1.1
    assert {one.name for one in task.certify(wrong, 1e-6).checks if not one.holds} == {"halves"}
