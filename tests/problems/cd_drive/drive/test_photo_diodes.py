"""The characteristics of the diodes: slopes, extremes, folds and light."""

import dataclasses

import numpy as np
import pytest
from workbench.plants.cd_drive.drive import tables
from workbench.plants.cd_drive.drive.photo_diodes import (
    S_CURVE_LINEAR,
    S_CURVE_PEAK,
    TRACK_PITCH,
    diode_parameters,
    diode_signals,
)

from workbench.errors import InputError

ERROR = np.linspace(-15e-6, 15e-6, 30_001)


def normalised(drive, error, light=1.0):
    d1, d2 = diode_signals(drive, error, light)
    return (d1 - d2) / (d1 + d2)


@pytest.mark.parametrize("drive", tables.drives("focus"), ids=lambda drive: drive.name)
def test_s_curve(drive):
    d1, d2 = diode_signals(drive, ERROR)
    f_en = (d1 - d2) / (d1 + d2)
    inside = abs(ERROR) <= S_CURVE_LINEAR
    np.testing.assert_allclose(f_en[inside], drive.K_optn * ERROR[inside], atol=1e-9)
    np.testing.assert_allclose((d1 - d2)[inside], drive.K_opt * ERROR[inside], atol=1e-9)
    for curve in (f_en, d1 - d2):  # 12 um peak to peak, and folding back beyond
        top, bottom = ERROR[np.argmax(curve)], ERROR[np.argmin(curve)]
        assert top - bottom == pytest.approx(12e-6, abs=2e-9)
        assert (np.diff(curve[abs(ERROR) <= S_CURVE_PEAK]) >= 0.0).all()
        assert (np.diff(curve[ERROR >= S_CURVE_PEAK]) < 0.0).all()
    assert min(d1.min(), d2.min()) >= 0.0
    assert abs(np.diff(f_en, 2)).max() < 1e-4  # no corner
    assert 1000 * max(d1.max(), d2.max()) < 5.0  # fits the converter behind 60 dB


@pytest.mark.parametrize("drive", tables.drives("radial"), ids=lambda drive: drive.name)
def test_radial_error_repeats_with_the_track(drive):
    step = 1e-10
    slope = np.diff(normalised(drive, [-step, step]))[0] / (2 * step)
    assert slope == pytest.approx(drive.K_optn, rel=1e-6)
    f_en = normalised(drive, ERROR)
    np.testing.assert_allclose(normalised(drive, ERROR + 3 * TRACK_PITCH), f_en, atol=1e-9)
    np.testing.assert_allclose(normalised(drive, TRACK_PITCH / 2 - ERROR), f_en, atol=1e-9)
    s1, s2 = diode_signals(drive, ERROR)
    np.testing.assert_allclose(s1 + s2, drive.K_opt / drive.K_optn)


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_light_drops_out(axis):
    drive = tables.drives(axis)[0]
    bright, dim = (normalised(drive, ERROR, light) for light in (1.0, 0.03))
    np.testing.assert_allclose(bright, dim, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize(("axis", "K_optn"), [("focus", 6e5), ("focus", 1e5), ("radial", 5e6)])
def test_slopes_that_no_characteristic_has(axis, K_optn):
    drive = dataclasses.replace(tables.drives(axis)[0], K_optn=K_optn)
    with pytest.raises(InputError, match="K_optn"):
        diode_parameters(drive)
