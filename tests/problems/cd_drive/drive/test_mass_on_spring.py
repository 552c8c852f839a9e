"""A mass on a damped spring against its differential equation and its closed forms."""

import numpy as np
import pytest
import xarray as xr
from workbench.plants.cd_drive.drive import mass_on_spring as spring


def test_response_is_that_of_equation_3_7():
    m, b, k = 5.6e-4, 7.6e-3, 20.5
    frequency = np.geomspace(1.0, 300.0, 20)
    s = 2j * np.pi * frequency
    natural = np.sqrt(k / m) / (2 * np.pi)
    found = spring.relative_response([b / (2 * np.sqrt(m * k))], frequency / natural)[0]
    assert found == pytest.approx(k / (m * s**2 + b * s + k))


def test_peaks():
    at, height = spring.peak([0.05, 0.3, 0.8])
    assert abs(spring.relative_response([0.3], [at[1]]))[0, 0] == pytest.approx(height[1])
    assert height[0] == pytest.approx(10.0, rel=0.01)
    assert np.isnan(at[2]) and np.isnan(height[2])


def test_wrong_curves_are_told():
    coordinates = {"zeta": list(spring.DAMPING_RATIOS), "relative": spring.RELATIVE_FREQUENCIES}
    right = spring.relative_response(*coordinates.values())
    curves = xr.DataArray(right, coordinates, ("zeta", "relative"))
    assert max(spring.peak_off(curves)) < 0.01
    assert spring.peak_off(1.1 * curves)[1] > 0.05
    shifted = curves.assign_coords(relative=1.1 * spring.RELATIVE_FREQUENCIES)
    assert spring.peak_off(shifted)[0] > 0.05
