"""Proofs start from the realisation as it was given, whatever coordinates doubles work in."""

import math
from fractions import Fraction

import control
import numpy as np
import pytest
from flint import acb, acb_mat, arb, ctx

from workbench.certify.balls import enclosed, in_plane, matrices_in_balls, response_of
from workbench.certify.modes.modal_form import FEWEST_QUICK, form_in_basis, real_balls
from workbench.certify.rounding import exact
from workbench.certify.stable_system import stable_system
from workbench.mu.frequency.channels import even_channels
from workbench.structure import Complex, Structure

PERIOD = 2.0**-20
CLUSTERED = [1 - 2.0**-12, 1 - 2.0**-13, 1 - 2.0**-14, 1 - 2.0**-15]
"""Poles near z = 1, exact in doubles."""


def clustered():
    """The product of 1 / (z - p) over the poles, as a chain whose entries are exact."""
    n = len(CLUSTERED)
    A = np.diag(CLUSTERED) + np.diag(np.full(n - 1, 2.0**-14), -1)
    return control.ss(A, np.eye(n, 1), np.eye(1, n, n - 1), 0.0, PERIOD)


def at(v):
    """Its response at the frequency v of the bilinear plane, in balls."""
    half = acb(0, arb(v) * arb(PERIOD) / 2)
    z = (1 + half) / (1 - half)
    found = acb(arb(2) ** (-14 * (len(CLUSTERED) - 1)))
    for pole in CLUSTERED:
        found /= z - pole
    return found


@pytest.mark.parametrize("v", [0.0, 3.0, 50.0, 1e3, 1e7])
def test_the_response_of_clustered_poles_has_all_its_digits(v):
    stable = stable_system(clustered(), sampled=True)
    with ctx.workprec(256):
        found, truth = response_of(stable, v)[0, 0], at(v)
        assert found.overlaps(truth)
        assert (found - truth).abs_upper() < arb(10) ** -60 * abs(truth)


@pytest.mark.parametrize("v", [0.0, 50.0, math.inf])
def test_gains_of_channels_are_not_rounded(v):
    third = 1 / 3
    stable = stable_system(clustered(), sampled=True)
    scaled = stable.channels([0], [0], third, 0.1).channels([0], [0], 7.0)
    with ctx.workprec(256):
        gain = Fraction(third) * Fraction(0.1) * 7
        wanted = response_of(stable, v)[0, 0] * arb(gain.numerator) / arb(gain.denominator)
        found = response_of(scaled, v)[0, 0]
        assert found.overlaps(wanted)
        assert (found - wanted).abs_upper() <= arb(10) ** -60 * abs(wanted)


def test_matrices_in_continuous_time_have_the_same_response():
    stable = stable_system(clustered(), sampled=True).channels([0], [0], 3.0, 5.0)
    with ctx.workprec(256):
        A, B, C, D = matrices_in_balls(stable)
        unit = acb_mat(np.eye(A.nrows()).tolist())
        there = (D + C * (acb(0, 50.0) * unit - A).solve(B))[0, 0] / 15
        assert there.overlaps(at(50.0))
        assert there.rad() < arb(10) ** -50 * abs(at(50.0))


@pytest.mark.parametrize("omega", [0.0, 1e-3, 50.0, 3.2e6])
def test_a_frequency_is_in_the_plane_exactly(omega):
    found = in_plane(omega, PERIOD)
    with ctx.workprec(400):
        truth = (arb(omega) * arb(PERIOD) / 2).tan() * 2 / arb(PERIOD)
        assert abs(arb(found) - truth) <= arb(10) ** -60 * truth
    assert math.isinf(in_plane(math.pi / PERIOD, PERIOD))
    assert in_plane(omega, 0.0) == omega


def test_balanced_coordinates_keep_the_system_that_was_given():
    even, period = even_channels(clustered(), Structure([Complex(1)]))
    assert period == PERIOD and even.period == 0.0
    assert any(error.any() for error in even.errors)
    with ctx.workprec(256):
        assert response_of(even, 50.0)[0, 0].overlaps(at(50.0))
        assert response_of(even, 50.0)[0, 0].rad() < arb(10) ** -60 * abs(at(50.0))


@pytest.mark.parametrize("n", [FEWEST_QUICK - 1, FEWEST_QUICK + 3])
@pytest.mark.parametrize("balls", [False, True])
def test_a_form_in_a_basis_encloses_the_system(n, balls):
    rng = np.random.default_rng(n)
    A = rng.normal(size=(n, n)) / np.sqrt(n) - 2 * np.eye(n)
    parts = A, rng.normal(size=(n, 2)), rng.normal(size=(3, n))
    T = np.linalg.qr(rng.normal(size=(n, n)))[0] @ np.diag(np.geomspace(1.0, 1e3, n))
    found = form_in_basis([real_balls(part) for part in parts] if balls else parts, T, 128)
    assert all((part.rad <= 1e-13 * np.abs(part.mid).max()).all() for part in found)
    with ctx.workprec(256):
        unit = acb_mat(np.eye(n).tolist())
        for s in (acb(0, 0), acb(0, 1.7)):
            ours, given = (
                C * (s * unit - A).solve(B)
                for A, B, C in (map(enclosed, found), map(enclosed, map(exact, parts)))
            )
            assert ours.overlaps(given)
            assert all(entry.rad() < 1e-6 for entry in ours.entries())


def test_a_singular_basis_gives_no_form():
    for n in (3, FEWEST_QUICK):
        parts = -np.eye(n), np.ones((n, 1)), np.ones((1, n))
        assert form_in_basis(parts, np.ones((n, n)), 128) is None
