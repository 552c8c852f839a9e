"""Scalings: their slopes, their systems, and that a fit reaches the bound."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.mu import upper_bound
from workbench.structure import Complex, Full, Structure
from workbench.synthesis.scalings import Scalings, diagonals

OMEGA = np.geomspace(0.01, 100.0, 60)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 2), st.integers(0, 3))
def test_systems_have_the_magnitudes_and_inverses(seed, blocks, biquads):
    scalings = Scalings(blocks, biquads)
    x = np.random.default_rng(seed).normal(size=(blocks, scalings.size))
    value, _ = scalings.log_magnitude(x, OMEGA)
    pairs = zip(scalings.systems(x), scalings.systems(scalings.inverse(x)), value, strict=True)
    for d, inverse, log in pairs:
        np.testing.assert_allclose(np.abs(d(1j * OMEGA)), np.exp(log), rtol=1e-6)
        np.testing.assert_allclose(np.abs(inverse(1j * OMEGA)), np.exp(-log), rtol=1e-6)
        assert (d.poles().real < 0).all()
        assert (d.zeros().real < 0).all()


def test_slopes_are_those_of_the_magnitudes():
    scalings, step = Scalings(2, 2), 1e-6
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
    hidden = Scalings(2, 1)
    x = hidden.guess(np.array([1.0, -2.0]), 0.0, 1.0)
    x[:, 1] += [1.0, -1.0]
    rows, columns = diagonals(structure, -hidden.log_magnitude(x, OMEGA)[0])
    M = rng.normal(size=(1, 4, 3)) + 1j * rng.normal(size=(1, 4, 3))
    M = np.exp(rows)[:, :, None] * M * np.exp(-columns)[:, None, :]
    bound = upper_bound(M, structure).value
    guess = hidden.guess(np.zeros(2), 0.0, 0.6)
    _, missed = hidden.fit(M, structure, OMEGA, bound, guess)
    assert missed == pytest.approx(0.0, abs=0.02)
