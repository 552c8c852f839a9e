"""Roots far from the data are brought to where a realisation has them, and change little there."""

import numpy as np
import pytest

from workbench.fitting.rational import Rational
from workbench.fitting.reach import within_reach

OMEGA = 2 * np.pi * np.geomspace(5.0, 5000.0, 200)


def realised(function: Rational) -> np.ndarray:
    system = function.state_space()
    return np.array([system(1j * omega) for omega in OMEGA])


def test_a_real_weight_that_no_realisation_had():
    """W_r of 1,000 plants of bench/covers, by `joint`: poles at 4e8 times the last frequency."""
    zeros = np.array([-3232.8454191, -55610.5594522, 57919.4595244, -1520440.70954181], complex)
    pair = -1.07684193e06 + 3.11465895e08j
    poles = np.array([-2467.77140, pair, np.conj(pair), -1.37559359e13])
    weight = Rational(zeros, poles, -111906129333961.7)
    response = weight.response(OMEGA)
    assert np.abs(realised(weight) / response - 1).max() > 1.0
    near = within_reach(weight, OMEGA, 1e3)
    assert np.abs(near.response(OMEGA) / response - 1).max() < 4e-3
    assert np.abs(realised(near) / near.response(OMEGA) - 1).max() < 1e-6


@pytest.mark.parametrize("reach", [1e2, 1e3, 1e9])
def test_far_roots_change_the_response_by_their_number_over_the_reach(reach):
    far = OMEGA[-1] * reach * 1e4
    function = Rational(np.array([-far, -3.0]), np.array([-far * 7, -50.0, -1e-12 * OMEGA[0]]), 2.0)
    near = within_reach(function, OMEGA, reach)
    assert np.abs(near.response(OMEGA) / function.response(OMEGA) - 1).max() < 3.1 / reach + 1e-12
    roots = np.abs([*near.zeros, *near.poles])
    assert (OMEGA[0] / reach * (1 - 1e-12) <= roots).all()
    assert (roots <= OMEGA[-1] * reach * (1 + 1e-12)).all()


def test_roots_within_reach_stay_as_they_are():
    function = Rational(np.array([-30.0 + 1j, -30.0 - 1j]), np.array([-1.0, -20.0]), -4.0)
    near = within_reach(function, OMEGA, 1e3)
    assert near.response(OMEGA) == pytest.approx(function.response(OMEGA), rel=1e-14)
    assert np.array_equal(near.poles, function.poles)
