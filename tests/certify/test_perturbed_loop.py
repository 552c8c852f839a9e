"""Perturbations proven to destabilise a system, and gains proven to be reached."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.certify.balls import middle, response_of
from workbench.certify.perturbed_loop import (
    proven_at,
    proven_gain,
    proven_over_frequency,
)
from workbench.certify.stable_system import stable_system
from workbench.mu import peak
from workbench.structure import Complex, Full, Real, Structure

REAL = Structure([Real(1)])


def oscillator(damping, reach):
    """x'' + 2 (damping - reach d) x' + x = 0: unstable for d > damping / reach."""
    A, B, C = [[0, 1], [-1, -2 * damping]], [[0], [2 * reach]], [[0, 1]]
    return stable_system(control.ss(A, B, C, 0))


@pytest.mark.parametrize("damping", [0.1, 1e-4, 1e-8])
def test_a_real_scalar_that_takes_all_damping(damping):
    system = oscillator(damping, 0.5)
    level = 0.5 / damping
    value = proven_over_frequency(system, REAL, np.array([[1 / level]]))
    assert level * (1 - 1e-4) <= value <= level
    less = proven_over_frequency(system, REAL, np.array([[0.999 / level]]))
    assert less == 0
    # At one frequency the same scalar makes two equations, which only exact numbers solve.
    assert proven_at(system, REAL, np.array([[1 / level]]), 1.0 + 1e-9) == 0


def test_an_ill_posed_loop_is_proven_at_infinity():
    system = stable_system(control.ss(-1, 1, 1, 2))
    assert proven_at(system, REAL, np.array([[0.5]]), np.inf) == pytest.approx(2)


def test_the_response_is_that_of_the_system():
    system = stable_system(control.ss(-np.eye(2), [[1, 2], [3, 4]], np.eye(2), np.eye(2)))
    for omega in (0.0, 0.3, 1e5, np.inf):
        np.testing.assert_allclose(
            middle(response_of(system, omega)), system.response([omega])[0], rtol=1e-14
        )


def test_gains_are_those_of_the_loop():
    # F = 3 / (s + 1 - delta) for |delta| <= 1/2
    system = stable_system(control.ss(-1, [[1, 3]], [[1], [1]], np.zeros((2, 2))))
    value = proven_gain(system, REAL, np.array([[0.5]]), 0.0)
    assert 6 * (1 - 1e-12) <= value <= 6
    assert proven_gain(system, REAL, np.array([[1.5]]), 0.0) == 0  # too large
    assert proven_gain(system, REAL, np.array([[1.0]]), 0.0) == 0  # singular


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 10**6))
def test_a_peak_is_never_below_what_is_proven(seed):
    rng = np.random.default_rng(seed)
    structure = Structure([[Real(1), Full(1, 2)], [Real(2), Complex(1)], [Complex(3)]][seed % 3])
    A = rng.standard_normal((5, 5))
    A -= (np.linalg.eigvals(A).real.max() + 10 ** rng.uniform(-3, 0)) * np.eye(5)
    B = rng.standard_normal((5, structure.rows))
    C = rng.standard_normal((structure.columns, 5))
    system = control.ss(A, B, C, np.zeros((structure.columns, structure.rows)))
    found = peak(system, structure, tolerance=1e-2)
    assert 0 < found.lower <= found.upper
    if found.Delta.imag.any() or any(isinstance(block, Real) for block in structure):
        assert np.linalg.norm(found.Delta, 2) <= (1 + 1e-12) / found.lower
