"""Spots of a round pupil against the Airy pattern, geometric optics and each other."""

import numpy as np
import pytest
from scipy.special import j0, j1

from workbench.errors import InputError
from workbench.optics import defocus, round_pupil, share_within, spot
from workbench.optics.spots import far_field

PUPIL = round_pupil(96)
PLACE = (np.arange(160) - 79.5) / 8


def test_a_focused_pupil_makes_an_airy_disc():
    """The light within a radius is 1 - J0^2 - J1^2 of 2 pi times it."""
    place = (np.arange(160) - 79.5) / 40
    intensity = spot(PUPIL, PUPIL.share.astype(complex), place)
    radius = np.hypot(place[:, None], place)
    for edge in (0.3, 0.61, 1.9):
        light = intensity[radius < edge].sum() / 1600
        x = 2 * np.pi * edge
        assert light == pytest.approx(1 - j0(x) ** 2 - j1(x) ** 2, abs=0.015)
    assert intensity.max() == pytest.approx(np.pi, rel=0.01)


def test_defocus_lowers_the_middle_as_the_sinc_says():
    """A quarter of a wavelength at the edge leaves 81 % in the middle (Rayleigh)."""
    path = defocus(PUPIL, 0.1)
    field = PUPIL.share * np.exp(0.5j * np.pi * path / path.max())
    middle = spot(PUPIL, field, np.array([0.0, 0.1]))[0, 0] / np.pi
    assert middle == pytest.approx(np.sinc(0.25) ** 2, rel=0.01)
    assert path.max() == pytest.approx(0.1**2 / 2, rel=0.02)


def test_a_knife_in_the_focus_does_what_half_a_pupil_does():
    """The two arrangements of Foucault's method give the same difference of two diodes."""
    path = defocus(PUPIL, 0.3)
    whole = PUPIL.share * np.exp(6j * path / path.max())
    half = whole * (PUPIL.x > 0.0)[:, None]
    places = (np.arange(360) - 179.5) / 8
    cell = 1 / 64
    split = spot(PUPIL, half, places)
    by_split = (split[places > 0].sum() - split[places < 0].sum()) * cell
    focus = far_field(PUPIL, whole, places) * (places > 0.0)[:, None]
    turn = np.exp(-2j * np.pi * np.outer(PUPIL.x, places)) / 8
    behind = abs(turn @ focus @ turn.T) ** 2 / np.pi * PUPIL.step**2
    by_knife = behind[PUPIL.x > 0].sum() - behind[PUPIL.x < 0].sum()
    assert abs(by_split) > 0.1
    assert by_knife == pytest.approx(by_split, rel=0.05)


def test_shares_of_cells_add_to_a_width():
    share = share_within(PLACE, [-1.03, 0.0], [0.5, 2.77])
    assert share.sum(axis=1) / 8 == pytest.approx([1.53, 2.77])
    assert share.min() == 0.0
    assert share.max() == 1.0


def test_bad_input_is_refused():
    with pytest.raises(InputError, match="8 at least"):
        round_pupil(4)
    for NA in (0.0, 1.0, np.nan):
        with pytest.raises(InputError, match="NA"):
            defocus(PUPIL, NA)
