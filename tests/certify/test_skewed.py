"""Lower bounds of the skewed mu, of loops of scalars whose determinant is one product."""

import math

import numpy as np
import pytest

from workbench.certify.skewed import proven_skew
from workbench.structure import Complex, Full, Real, Structure

SECOND_VARIES = np.array([False, True])


def proven(M, blocks, varies, Delta):
    return proven_skew(np.asarray(M), Structure(blocks), np.asarray(varies), np.asarray(Delta))


def around(*factors):
    """A ring: I - M Delta is singular where the product of factors and deltas is 1."""
    return np.roll(np.diag(factors), 1, axis=0)


@pytest.mark.parametrize(("fixed", "value"), [(1.0, 6.0), (-1.0, 6.0), (0.5, 3.0), (1.5, 0.0)])
def test_a_fixed_scalar_is_at_most_one(fixed, value):
    """2 * 3 * fixed * varying = 1."""
    Delta = np.diag([fixed, 1 / (6 * fixed)])
    found = proven(around(2.0, 3.0), [Complex(1)] * 2, SECOND_VARIES, Delta)
    assert found == pytest.approx(value, rel=1e-12)
    assert found <= value


@pytest.mark.parametrize(("m", "fixed", "value"), [(2.0, 0.5, math.inf), (0.5, 2.0, 0.0)])
def test_fixed_scalars_alone(m, fixed, value):
    """m * fixed = 1 without the varying one: a fault only where fixed is at most 1."""
    Delta = np.diag([fixed, 0.0])
    assert proven(np.diag([m, 0.0]), [Complex(1)] * 2, SECOND_VARIES, Delta) == value


def test_a_fixed_scalar_closes_a_loop_of_its_own():
    """det(I - M Delta) = 1 - fixed / 2 - 3 fixed varying."""
    Delta = np.diag([1.0, 0.5 / 3.0])
    found = proven([[0.5, 1.0], [3.0, 0.0]], [Complex(1)] * 2, SECOND_VARIES, Delta)
    assert found == pytest.approx(6.0, rel=1e-12)


@pytest.mark.parametrize(
    ("gain", "fixed", "value"), [(2.0, 0.9, 1.8), (0.5, 0.9, 0.45), (2.0, 1.5, 0.0)]
)
def test_all_blocks_move_together_where_the_fixed_one_must_turn(gain, fixed, value):
    """gain e^(0.7 j) fixed varying = 1 with a real varying one: fixed turns by its last bits."""
    M = around(1.0, gain * np.exp(0.7j))
    Delta = np.diag([fixed * np.exp(-0.7j), 1 / (gain * fixed)])
    found = proven(M, [Complex(1), Real(1)], SECOND_VARIES, Delta)
    assert found == pytest.approx(value, rel=1e-9)


def test_the_largest_varying_block_counts():
    M = around(1.0, 1.0, np.exp(0.7j) / 0.9)
    Delta = np.diag([0.9 * np.exp(-0.7j), 0.5, 2.0])
    found = proven(M, [Complex(1), Real(1), Real(1)], [False, True, True], Delta)
    assert found == pytest.approx(0.5, rel=1e-9)


def test_blocks_that_are_not_square():
    """A fixed scalar at its limit, where all blocks together prove nothing, and one row.

    z_1 = v_2, z_2 = 2 v_1, z_3 = 0: the row (1/2, 0) closes the ring.
    """
    M = np.array([[0.0, 1.0], [2.0, 0.0], [0.0, 0.0]])
    Delta = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    found = proven(M, [Complex(1), Full(1, 2)], SECOND_VARIES, Delta)
    assert found == pytest.approx(2.0, rel=1e-9)
