"""Light from periodic layers against the areas in which orders overlap."""

import numpy as np
import pytest
from scipy.integrate import quad

from workbench.errors import InputError
from workbench.optics import TrackLayer, quadrants, read_layer, round_pupil

PUPIL = round_pupil(160)
WHOLE = np.ones((1, 160, 160))


def overlap(distance):
    """Common area of two circles of radius 1, over that of one."""
    half = distance / 2
    return 2 / np.pi * (np.arccos(half) - half * np.sqrt(1 - half**2))


@pytest.mark.parametrize("phase", [0.4, np.pi / 2, 3.0])
def test_a_groove_sends_back_what_its_orders_say(phase):
    """With a pitch of less than a unit only neighbouring orders meet, each in one half."""
    pitch, width = 0.9, 0.3
    layer = TrackLayer(pitch, 1.0, 1.0, width, phase)
    place = np.linspace(-0.5, 0.5, 9) * pitch
    mean = read_layer(layer, PUPIL, place, quadrants(PUPIL)).mean
    rest = np.exp(1j * phase) - 1
    zeroth = 1 + width / pitch * rest
    first = width / pitch * np.sinc(width / pitch) * rest
    turn, shared = 2 * np.pi * place / pitch, overlap(1 / pitch)
    light = abs(zeroth) ** 2 + 2 * shared * abs(first) ** 2
    light = light + 4 * shared * (np.conj(zeroth) * first).real * np.cos(turn)
    assert mean.sum(axis=1) == pytest.approx(light, abs=0.01)
    pushed = mean[:, :2].sum(axis=1) - mean[:, 2:].sum(axis=1)
    size = width / pitch * np.sinc(width / pitch) * np.sin(phase)
    assert pushed == pytest.approx(-4 * shared * size * np.sin(turn), abs=0.01)


@pytest.mark.parametrize("blur", [0.2, 0.6])
def test_tracks_fade_out_of_focus_as_the_overlap_says(blur):
    """Between a circle and its copy a quadratic path leaves a phase that is linear across them."""
    pitch, width, phase = 0.9, 0.3, 1.1
    layer = TrackLayer(pitch, 1.0, 1.0, width, phase)
    place = np.array([0.0, pitch / 2])
    reading = read_layer(layer, PUPIL, place, WHOLE, aberration=lambda radius: blur * radius**2)
    light = reading.mean[:, 0]

    def fringe(x):
        inside = 1.0 - (abs(x) + 0.5 / pitch) ** 2
        return 2.0 * np.sqrt(max(inside, 0.0)) * np.cos(4 * np.pi * blur * x / pitch) / np.pi

    end = 1.0 - 0.5 / pitch
    shared = quad(fringe, -end, end)[0]
    rest = np.exp(1j * phase) - 1
    zeroth, first = 1 + width / pitch * rest, width / pitch * np.sinc(width / pitch) * rest
    expected = 8 * shared * (np.conj(zeroth) * first).real
    assert light[0] - light[1] == pytest.approx(expected, abs=0.01)
    assert abs(shared) < 0.95 * overlap(1 / pitch)


def test_carrier_of_a_grating_along_the_track():
    period, phase = 0.8, 1.2
    layer = TrackLayer(0.5, period, 0.4, 0.5, phase)
    carrier = read_layer(layer, PUPIL, np.zeros(1), WHOLE).carrier[0, 0]
    rest = np.exp(1j * phase) - 1
    zeroth, first = 1 + 0.5 * rest, 0.5 * np.sinc(0.5) * rest
    expected = 2 * (np.conj(zeroth) * first).real * overlap(1 / period)
    assert carrier == pytest.approx(expected, abs=0.01)


def test_a_layer_without_contrast_is_a_mirror():
    layer = TrackLayer(0.9, 2.0, 1.0, 0.3, 0.0)
    reading = read_layer(layer, PUPIL, np.array([0.0, 0.2]), WHOLE)
    assert reading.mean == pytest.approx(1.0)
    assert abs(reading.carrier).max() < 1e-12


def test_a_stagger_by_a_whole_period_changes_nothing():
    place = np.array([0.1, 0.3])
    readings = [
        read_layer(TrackLayer(0.9, 1.5, 0.7, 0.3, 2.0, stagger=one), PUPIL, place, WHOLE)
        for one in (0.0, 1.0, 0.5)
    ]
    assert readings[1].carrier == pytest.approx(readings[0].carrier)
    assert abs(readings[2].carrier - readings[0].carrier).max() > 1e-3


def test_displaced_quadrants_share_the_light_otherwise():
    layer = TrackLayer(0.9, 1.5, 0.7, 0.3, 2.0)
    centred, moved = (
        read_layer(layer, PUPIL, np.zeros(1), quadrants(PUPIL, shift=shift)).mean[0]
        for shift in (0, 0.2)
    )
    assert centred[:2].sum() == pytest.approx(centred[2:].sum())
    assert moved[:2].sum() < centred[:2].sum() - 0.01
    assert moved.sum() == pytest.approx(centred.sum())


def test_bad_input_is_refused():
    for wrong in ({"length": 2.0}, {"length": 0.0}, {"width": 1.0}, {"pitch": np.nan}):
        good = {"pitch": 0.9, "period": 1.5, "length": 0.7, "width": 0.3, "phase": 1.0}
        with pytest.raises(InputError, match="need 0 <"):
            TrackLayer(**(good | wrong))
    with pytest.raises(InputError, match="detectors are"):
        read_layer(TrackLayer(0.9, 1.5, 0.7, 0.3, 1.0), PUPIL, np.zeros(1), np.ones((1, 8, 8)))
