"""The second opinion of fits and of models of records."""

import control
import numpy as np
import pytest
from scipy.signal import dlsim

from workbench.fitting.rational import Rational
from workbench.second_opinion import fits
from workbench.second_opinion.records import convolved

OMEGA = np.geomspace(0.1, 10.0, 30)
SYSTEM = control.ss([[-1.0]], [[1.0]], [[1.0]], [[1.0]])  # (s + 2) / (s + 1)
VALUES = (1j * OMEGA + 2) / (1j * OMEGA + 1)


def test_a_realisation_is_compared_with_its_roots():
    assert fits.realisation_agrees(SYSTEM, OMEGA, VALUES, np.abs(VALUES)).holds
    assert not fits.realisation_agrees(SYSTEM, OMEGA, 1.01 * VALUES, np.abs(VALUES)).holds


def test_decay_of_a_fit_and_of_its_inverse():
    growing = control.ss([[1e-3]], [[1.0]], [[1.0]], [[1.0]])
    assert fits.decays(SYSTEM, "fit").holds
    assert not fits.decays(growing, "fit").holds
    for zero, holds in ((-1e-3, True), (1e-3, False)):
        fit = Rational(np.array([zero]), np.array([-1.0]), 2.0)
        assert fits.inverse_decays(fit, "inverse").holds == holds


def test_a_cover_is_tried_between_the_data():
    magnitude = np.abs(VALUES)
    two = np.array([0.1, 10.0])
    assert fits.covers(SYSTEM, OMEGA, 0.98 * magnitude).holds
    assert not fits.covers(SYSTEM, OMEGA, 1.01 * magnitude).holds
    dip = control.ss([[-0.1, -1], [1, 0]], [[1.0], [0.0]], [[-0.09, 0.0]], [[1.0]])
    ends = np.abs(dip(1j * two))
    assert not fits.covers(dip, two, 0.99 * ends).holds


def test_convolution_is_simulation():
    rng = np.random.default_rng(3)
    A, B = np.array([[0.9, 0.2], [-0.2, 0.8]]), rng.standard_normal((2, 2))
    C, D = rng.standard_normal((1, 2)), rng.standard_normal((1, 2))
    u = rng.standard_normal((200, 2))
    y = dlsim((A, B, C, D, 1.0), u, x0=np.array([1.0, -2.0]))[1]
    assert convolved((A, B, C, D), u, y, 20) == pytest.approx(y, abs=1e-10)
