"""What is proven of plants that no stable controller stabilises, with zeros that are doubles."""

import math

import control
import numpy as np
import pytest

from workbench.certify.interlacing import interlacing, separated_zeros

INFINITY = (math.inf, math.inf)


def companion(poles, C, D=0.0, dt=0):
    """A plant with one input, real poles and an output row whose numerator is C, exactly."""
    n = len(poles)
    coefficients = np.poly(poles)
    A = np.eye(n, k=1)
    A[-1] = -coefficients[:0:-1]
    B = np.zeros((n, 1))
    B[-1] = 1.0
    return control.StateSpace(A, B, C, D, dt, remove_useless_states=False)


def siso(zeros, poles, dt=0):
    numerator = np.poly(zeros)[::-1]
    if len(zeros) < len(poles):
        return companion(poles, [[*numerator, *[0.0] * (len(poles) - len(numerator))]], dt=dt)
    rest = numerator - np.poly(poles)[::-1]  # of a direct term of 1
    return companion(poles, [rest[:-1]], 1.0, dt)


def proven(plant, low, high):
    found = interlacing(plant, low, high)
    return found.low_zero, found.high_zero, found.opposite


def about(zero, width=0.25):
    return zero - width, zero + width


def test_zeros_with_a_pole_between_are_proven():
    plant = siso([1.0, 3.0], [2.0, -1.0, -1.0])
    assert proven(plant, about(1.0), about(3.0)) == (True, True, True)
    assert proven(plant, about(1.0), INFINITY) == (True, True, True)
    assert proven(plant, about(3.0), INFINITY) == (True, True, False)
    assert separated_zeros(plant) is not None


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (about(1.0, 0.0), about(3.0, 0.0), (True, True, True)),
        (about(1.5), about(3.0), (False, True, True)),
        (about(1.0), about(4.0), (True, False, True)),
        (about(1.0), (2.0, 3.5), (True, True, False)),  # the pole is an end
        (about(1.0), (1.5, 3.5), (True, True, False)),  # and inside
        ((0.25, 2.0), about(3.0), (True, True, False)),
        (about(3.0), about(1.0), (False, False, False)),  # not in order
    ],
)
def test_a_range_proves_what_lies_in_it(low, high, expected):
    assert proven(siso([1.0, 3.0], [2.0, -1.0, -1.0]), low, high) == expected


def test_ranges_left_of_zero_prove_nothing():
    plant = siso([-3.0, 3.0], [2.0, -1.0, -1.0])
    assert proven(plant, about(-3.0), about(3.0)) == (False, False, False)


def test_a_sampled_plant_proves_nothing():
    plant = siso([1.0, 3.0], [2.0, -1.0, -1.0], dt=1.0)
    assert proven(plant, about(1.0), about(3.0)) == (False, False, False)


def test_a_direct_term_takes_the_zero_at_infinity():
    plant = siso([1.0, 3.0, -1.0], [2.0, -1.0, -2.0])
    assert proven(plant, about(1.0), about(3.0)) == (True, True, True)
    assert proven(plant, about(1.0), INFINITY) == (True, False, True)


def test_a_double_zero_is_one():
    plant = siso([1.0, 1.0], [2.0, -1.0, -1.0])
    assert proven(plant, about(1.0), INFINITY) == (True, True, True)


@pytest.mark.parametrize("both", [True, False])
def test_a_zero_of_one_entry_blocks_nothing(both):
    """The second output has the zero at 1 too, or one at 1.5: the first one alone is no zero."""
    one, other = siso([1.0], [2.0, -1.0]), siso([1.0 if both else 1.5], [2.0, -1.0])
    C = np.vstack([one.C, other.C])
    for order in (C, C[::-1]):
        plant = control.StateSpace(one.A, one.B, order, np.zeros((2, 1)))
        assert proven(plant, about(1.0, 0.125), INFINITY)[0] is both


@pytest.mark.parametrize("gain", [1.0, -2.0, 3.0])
def test_the_gain_moves_no_zero(gain):
    plant = siso([1.0, 3.0], [2.0, -1.0, -1.0])
    scaled = control.StateSpace(plant.A, gain * plant.B, plant.C, plant.D)
    assert proven(scaled, about(1.0), about(3.0)) == (True, True, True)
    assert proven(scaled, about(2.0, 0.5), about(3.0))[0] is False


def test_a_sign_is_proven_on_all_of_a_range():
    """p = (s - 2) (s - 3) is negative between: from 2.25 to 2.75 all of it, from 1.5 on not."""
    plant = siso([2.5], [2.0, 3.0, -1.0])
    assert proven(plant, about(2.5), INFINITY) == (True, True, True)
    assert proven(plant, (1.5, 3.0), INFINITY) == (True, True, False)
    assert proven(plant, about(2.5, 0.5), INFINITY) == (True, True, False)


def test_a_root_at_the_end_of_a_range_has_no_sign():
    """p = s - 2 is zero at the lower end, positive elsewhere, and negative at 0."""
    plant = siso([3.0], [2.0])
    assert proven(plant, (0.0, 0.0), (2.0, 4.0)) == (False, True, False)
    assert proven(plant, (0.0, 0.0), (2.5, 4.0)) == (False, True, True)
