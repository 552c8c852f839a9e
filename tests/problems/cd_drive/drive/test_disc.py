"""Deviation, eccentricity and defects of a disc."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.disc import VELOCITY, Defect, Disc

from workbench.errors import InputError

TIME = np.arange(0.0, 2.0, 1 / 35e3)


def test_deviation_has_its_harmonics():
    disc = Disc(warp=(300e-6, 0.0, 5e-6), eccentricity=(70e-6,), rotation=8.0, run_up=0.0)
    spectrum = 2 * abs(np.fft.rfft(disc.deviation("focus", TIME))) / len(TIME)
    assert spectrum[[16, 32, 48]] == pytest.approx([300e-6, 0.0, 5e-6], abs=1e-12)
    assert abs(disc.deviation("radial", TIME)).max() == pytest.approx(70e-6, rel=1e-4)
    assert (Disc(offset=3e-6).deviation("focus", TIME) == 3e-6).all()


def test_deviation_grows_smoothly():
    deviation = Disc(warp=(1.0,), rotation=6.0, phase=0.25, run_up=0.5).deviation("focus", TIME)
    assert deviation[0] == 0.0
    assert abs(np.diff(deviation)[:10]).max() < 1e-4
    late = TIME > 0.5
    np.testing.assert_allclose(deviation[late], np.cos(12 * np.pi * TIME[late]), atol=1e-12)


def test_a_scratch_comes_once_a_revolution():
    scratch = Defect(length=1.3e-3, angle=0.5, depth=0.9, edge=0.1, displacement=2e-6)
    light, false = Disc(rotation=5.0).surface([scratch], TIME)
    begins = TIME[1:][(light[1:] < 1.0) & (light[:-1] == 1.0)]
    np.testing.assert_allclose(begins, 0.1 + 0.2 * np.arange(10), atol=1e-4)
    assert light.min() == pytest.approx(0.1)
    duration = np.count_nonzero(light < 0.55) / 35e3 / 10
    assert duration == pytest.approx(0.9 * 1.3e-3 / VELOCITY, rel=0.05)
    assert false.max() == pytest.approx(2e-6, rel=0.01)
    assert false.min() == pytest.approx(-2e-6, rel=0.01)
    assert (false[light == 1.0] == 0.0).all()


def test_defects_add_up_and_may_be_absent():
    disc = Disc(rotation=5.0, reflectivity=0.8)
    scratch, later = Defect(depth=0.5), Defect(depth=0.5, present=(1.0, np.inf), offset=1e-6)
    light, false = disc.surface([scratch, later], TIME)
    assert light.max() == 0.8
    assert light[TIME < 1.0].min() == pytest.approx(0.4)
    assert light[TIME > 1.0].min() == pytest.approx(0.2)
    assert false[TIME < 1.0].max() == 0.0
    assert false.max() == pytest.approx(1e-6)
    assert (Disc(rotation=0.0).surface([scratch], TIME)[0] == 1.0).all()


def test_a_sharp_edge():
    light, _ = Disc(rotation=5.0).surface([Defect(edge=0.0, depth=1.0)], TIME)
    assert set(np.unique(light)) <= {0.0, 1.0}
    assert light.min() == 0.0


@pytest.mark.parametrize("wrong", [{"length": 0.0}, {"depth": 1.1}, {"edge": 0.6}])
def test_defects_that_are_none(wrong):
    with pytest.raises(InputError, match="need length"):
        Defect(**wrong)


@pytest.mark.parametrize("wrong", [{"rotation": -1.0}, {"run_up": -0.1}, {"reflectivity": -1.0}])
def test_discs_that_are_none(wrong):
    with pytest.raises(InputError, match="negative"):
        Disc(**wrong)
