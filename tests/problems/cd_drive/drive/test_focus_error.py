"""Focus error curves against rays and against a closed form of Foucault's gain."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from workbench.plants.cd_drive.drive.focus_error import methods
from workbench.plants.cd_drive.drive.tables import disc_formats

from workbench import load
from workbench.errors import WorkbenchError

CD = disc_formats()["CD"]


def test_gain_of_foucault_is_paraxial_at_a_small_aperture():
    """3 NA^2 / (2 lambda), by the first order of the diffraction integral at the edge."""
    disc = replace(CD, NA=0.1)
    unit = disc.wavelength / disc.NA**2
    sensor = methods.FocusSensor(
        disc, np.array([-0.02, 0.0, 0.02]) * unit, 20 * disc.wavelength / 0.1
    )
    first, second = sensor.on_halves(sensor.knife(), sensor.reach)
    found = methods.gain(sensor.errors, (first - second) / (first + second))
    assert abs(found) == pytest.approx(1.5 / unit, rel=0.03)


def test_astigmatic_curve_is_that_of_rays_far_from_diffraction():
    """Rays land where |e + e_a| |x| = |e - e_a| |y| bounds the quadrants."""
    lines = 30e-6
    errors = np.array([-0.8, -0.4, 0.0, 0.4, 0.8]) * lines / 2
    sensor = methods.FocusSensor(CD, errors, 3.0 * lines * CD.NA)
    first, second = sensor.on_quadrants(sensor.astigmatic(lines), sensor.reach)
    found = (first - second) / (first + second)
    rays = 4 / np.pi * np.arctan((lines / 2 + errors) / (lines / 2 - errors)) - 1
    assert abs(found) == pytest.approx(abs(rays), abs=0.04)
    assert found == pytest.approx(-found[::-1], abs=1e-9)


def test_readings_of_a_curve():
    errors = np.linspace(-4.0, 4.0, 801)
    signal = np.sin(errors)
    assert methods.extremes(errors, signal) == pytest.approx(np.pi, abs=0.02)
    assert methods.gain(errors, signal) == pytest.approx(1.0, rel=1e-3)
    inside = abs(np.sin(errors) - errors) <= 0.1 * abs(errors)
    assert methods.linear_range(errors, signal) == pytest.approx(np.ptp(errors[inside]), abs=0.03)


def test_half_range_spans_both_sides():
    errors = np.linspace(-5.0, 5.0, 1001)
    signal = errors * np.exp(-(errors**2) / 2)
    told = errors[signal >= signal.max() / 2]
    assert methods.half_range(errors, signal) == pytest.approx(2 * told.max())


def test_problem(answered):
    study, solution = answered("cd/focus-error")
    assert solution.certificate.holds, solution.certificate
    numbers = study.metrics(solution.answer)
    assert numbers["extremes_Foucault_over_astigmatic_least"] >= 1.0
    assert numbers["gain_Foucault_per_um"] == pytest.approx(0.42, abs=0.02)
    wrong = solution.answer.copy(deep=True)
    wrong["difference"][0] *= 3.0
    wrong["difference"][1, ..., :10] += 0.1
    assert not study.certify(wrong, 1e-6).holds


def test_bad_input_is_refused():
    with pytest.raises((ValidationError, WorkbenchError)):
        load("cd/focus-error", errors=3)
    with pytest.raises((ValidationError, WorkbenchError)):
        load("cd/focus-error", objective=0.0)
