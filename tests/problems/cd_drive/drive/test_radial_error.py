"""Radial errors of the four methods where theory knows them."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.photo_diodes import TRACK_PITCH
from workbench.plants.cd_drive.drive.radial_error import methods

from workbench.errors import InputError


def test_pits_of_a_quarter_wavelength_push_and_pull_nothing():
    flat = methods.TrackSensor(0.25, 0.5e-6, 5).strengths()
    eighth = methods.TrackSensor(0.125, 0.5e-6, 5).strengths()
    assert flat[methods.PUSH_PULL] < 1e-12 < eighth[methods.PUSH_PULL]
    assert flat[methods.TWIN] == pytest.approx(2 * eighth[methods.TWIN])


def test_twin_spots_make_a_sine():
    """Orders beyond the first pass the pupil by, and the sum of both side spots is constant."""
    place = np.linspace(-0.5, 0.5, 17) * TRACK_PITCH
    error = methods.TrackSensor(0.2385, 0.5e-6, 7, 0.25).errors(place)[methods.TWIN]
    assert error == pytest.approx(error.max() * np.sin(2 * np.pi * place / TRACK_PITCH), abs=1e-9)


def test_phase_detection_stands_displaced_light_at_a_quarter_wavelength():
    for depth, false in ((0.25, False), (0.125, True)):
        sensor = methods.TrackSensor(depth, 0.5e-6, 5, landing=0.1)
        found = sensor.errors(np.zeros(1))[methods.DPD][0]
        assert bool(abs(found) > 1e-3) is false


def test_channel_bits_are_those_of_the_standard():
    assert 3 * methods.bit_length() == pytest.approx(0.9e-6, rel=0.01)
    assert 4 * methods.printed_depth() == pytest.approx(1.0, abs=0.05)


def test_problem(answered):
    study, solution = answered("cd/radial-error")
    assert solution.certificate.holds, solution.certificate
    numbers = study.metrics(solution.answer)
    assert numbers["best_depth_push_pull"] == 0.125
    assert numbers["offset_twin_spot_um"] == pytest.approx(0.0, abs=1e-9)
    wrong = solution.answer.copy(deep=True)
    wrong["light"][0, 0, 0, 5] += 0.1
    assert not study.certify(wrong, 1e-6).holds


def test_bad_input_is_refused():
    with pytest.raises(InputError, match="width <= pitch"):
        methods.TrackSensor(0.25, 2e-6, 5).layer()
