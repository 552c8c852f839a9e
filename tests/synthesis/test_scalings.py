"""Scalings: their slopes, their systems, and that a fit reaches the bound."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.mu import upper_bound
from workbench.structure import Complex, Full, Structure
from workbench.synthesis.mu.biquads import Biquads
from workbench.synthesis.mu.scaling_fit import ScalingFit, diagonals, worth
from workbench.systems.realisation import realisation

OMEGA = np.geomspace(0.01, 100.0, 60)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 2), st.integers(0, 3))
def test_systems_have_the_magnitudes_and_inverses(seed, blocks, biquads):
    scalings = Biquads(blocks, biquads)
    x = np.random.default_rng(seed).normal(size=(blocks, scalings.size))
    value, _ = scalings.log_magnitude(x, OMEGA)
    pairs = zip(scalings.realised(x), scalings.realised(scalings.inverse(x)), value, strict=True)
    for matrices, of_inverse, log in pairs:
        d, inverse = realisation(matrices, 0.0), realisation(of_inverse, 0.0)
        np.testing.assert_allclose(np.abs(d(1j * OMEGA)), np.exp(log), rtol=1e-6)
        np.testing.assert_allclose(np.abs(inverse(1j * OMEGA)), np.exp(-log), rtol=1e-6)
        assert (d.poles().real < 0).all()
        assert (d.zeros().real < 0).all()


def test_slopes_are_those_of_the_magnitudes():
    scalings, step = Biquads(2, 2), 1e-6
    x = np.random.default_rng(0).normal(size=(2, scalings.size))
    value, slope = scalings.log_magnitude(x, OMEGA)
    for k in range(scalings.size):
        y = x.copy()
        y[:, k] += step
        change = (scalings.log_magnitude(y, OMEGA)[0] - value) / step
        np.testing.assert_allclose(change, slope[:, k], atol=1e-5)


def test_a_fit_undoes_a_scaling_that_it_can_express():
    """M is small but for D that hides it."""
    rng = np.random.default_rng(3)
    structure = Structure([Complex(1), Full(1, 2), Full(1, 1)])
    hidden = Biquads(2, 1)
    x = hidden.guess(np.array([1.0, -2.0]), 0.0, 1.0)
    x[:, 1] += [1.0, -1.0]
    rows, columns = diagonals(structure, -hidden.log_magnitude(x, OMEGA)[0])
    M = rng.normal(size=(1, 4, 3)) + 1j * rng.normal(size=(1, 4, 3))
    M = np.exp(rows)[:, :, None] * M * np.exp(-columns)[:, None, :]
    bound = upper_bound(M, structure).value
    fit = ScalingFit.of(structure, OMEGA, M, bound)
    found, missed = worth(fit, (Biquads(2, 0), np.zeros((2, 1))))
    assert missed == pytest.approx(0.0, abs=1e-3)
    log = found[0].log_magnitude(found[1], OMEGA)[0]
    rows, columns = diagonals(structure, log)
    scaled = np.exp(rows)[:, :, None] * M * np.exp(-columns)[:, None, :]
    assert (np.linalg.norm(scaled, 2, axis=(1, 2)) / bound).max() == pytest.approx(np.exp(missed))


@settings(max_examples=20, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from([2.0, 8.0, 60.0]))
def test_slopes_and_curvature_of_the_smoothed_worst(seed, sharpness):
    rng = np.random.default_rng(seed)
    structure = Structure([Complex(1), Full(2, 1), Full(1, 2)])
    scalings = Biquads(2, 1)
    M = rng.normal(size=(4, 4, 4)) + 1j * rng.normal(size=(4, 4, 4))
    fit = ScalingFit.of(structure, np.array([0.1, 1.0, 2.0, 10.0]), M, rng.uniform(1, 3, 4))
    x = 0.3 * rng.normal(size=(2 * scalings.size))
    _, gradient, hessian = fit._cost(scalings, x, sharpness)
    step = 1e-5
    for k, along in enumerate(step * np.eye(len(x))):
        above, below = (fit._cost(scalings, x + sign * along, sharpness) for sign in (1, -1))
        assert (above[0] - below[0]) / (2 * step) == pytest.approx(gradient[k], abs=1e-6)
        np.testing.assert_allclose((above[1] - below[1]) / (2 * step), hessian[k], atol=1e-5)


def test_frequencies_that_tell_nothing_are_left_out():
    structure = Structure([Complex(1), Full(1, 1)])
    flat = np.ones((60, 2, 2)) * np.where(OMEGA < 1.0, 1.0, OMEGA)[:, None, None]
    fit = ScalingFit.of(structure, OMEGA, flat, np.ones(60))
    assert fit.omega[0] == OMEGA[0]
    assert fit.omega[-1] == OMEGA[-1]
    assert len(fit.omega) == (OMEGA >= 1.0).sum() + 1


def test_a_biquad_more_and_a_biquad_less():
    scalings = Biquads(2, 1)
    x = np.random.default_rng(1).normal(size=(2, 5))
    larger, y = scalings.grown(x, 3.0, np.array([0.3, -0.3]))
    same, back = larger.without(y, 1)
    assert same == scalings
    np.testing.assert_array_equal(back, x)
    neutral = scalings.grown(x, 3.0, np.zeros(2))
    log = neutral[0].log_magnitude(neutral[1], OMEGA)[0]
    np.testing.assert_allclose(log, scalings.log_magnitude(x, OMEGA)[0], atol=1e-12)
