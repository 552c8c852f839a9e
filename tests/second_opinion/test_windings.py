"""Upper bounds of mu, tried by the argument principle."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.mu import branch_and_bound, skew_bounds
from workbench.second_opinion.perturbations import turned_perturbations, windings
from workbench.structure import Complex, Full, Real, Structure

STRUCTURES = [
    [Complex(1)],
    [Real(1), Complex(1)],
    [Real(1), Real(1), Real(1)],
    [Real(2), Full(2, 1), Complex(1)],
    [Full(2, 2), Real(1)],
]


def matrix(structure, seed):
    rng = np.random.default_rng(seed)
    real, imag = rng.normal(size=(2, structure.columns, structure.rows))
    return real + 1j * imag


@pytest.mark.parametrize("blocks", STRUCTURES, ids=str)
def test_curves_are_closed_and_lie_in_the_ball(blocks):
    structure = Structure(blocks)
    curves = turned_perturbations(structure, 16, 64)
    assert np.linalg.norm(curves, 2, axis=(-2, -1)).max() <= 1 + 1e-12
    assert all(structure.contains(one) for one in curves[:, ::7].reshape(-1, *curves.shape[-2:]))
    steps = np.abs(np.roll(curves, -1, axis=1) - curves).max(axis=(1, 2, 3))
    assert steps.max() < 0.2


def test_a_determinant_goes_round_as_often_as_eigenvalues_are_larger_than_1():
    turn = np.exp(2j * np.pi * np.arange(64) / 64)
    curve = (turn[:, None, None] * np.eye(3))[None]
    assert windings(np.diag([2.0, 3.0, 0.5]), curve).tolist() == [2.0]
    assert windings(np.diag([0.9, 0.1, 0.5]), curve).tolist() == [0.0]
    assert np.isnan(windings(np.diag([1.0, 0.1, 0.5]), curve)).all()


@pytest.mark.parametrize("size", [0.97, 0.994, 0.9999, 1.0001, 1.006])
def test_factors_that_pass_0_together_are_not_miscounted(size):
    """Each turns by half a circle within one step, and both by none that is seen."""
    for offset in np.linspace(0.0, 1.0, 9):
        turn = np.exp(2j * np.pi * (np.arange(64) + offset) / 64)
        curve = (turn[:, None, None] * np.eye(2))[None]
        (found,) = windings(size * np.eye(2), curve)
        assert np.isnan(found) or found == (0.0 if size < 1 else 2.0)


@pytest.mark.parametrize("blocks", STRUCTURES, ids=str)
def test_bounds_that_are_right_pass_and_those_too_small_are_refuted(blocks):
    structure, noticed = Structure(blocks), 0
    for seed in range(6):
        found = branch_and_bound(matrix(structure, seed), structure, tolerance=0.1)
        assert found.holds
        if found.upper == 0.0:
            continue
        spoilt = replace(found, lower=0.0, upper=0.7 * found.upper)
        noticed += not all(one.holds for one in found._checked_by[0].second_opinion(spoilt))
    assert noticed >= 3


@pytest.mark.cases(1)
@pytest.mark.parametrize("fixed", [[0], [1]])
def test_skewed_bounds_that_are_too_small_are_refuted(fixed):
    structure, noticed = Structure([Real(1), Complex(1), Full(2, 1)]), 0
    M = np.array([0.3 * matrix(structure, seed) for seed in range(4)])
    found = skew_bounds(M, structure, fixed)
    assert found.holds
    for k in range(len(M)):
        one = skew_bounds(M[k], structure, fixed)
        spoilt = replace(one, upper=0.7 * one.upper)
        noticed += not all(each.holds for each in one._checked_by[0].second_opinion(spoilt))
    assert noticed >= 3
