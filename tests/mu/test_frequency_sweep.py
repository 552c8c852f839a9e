"""Sweeps: narrow peaks are found, the bounds are in order, and what is asked is given."""

import control
import numpy as np
import pytest

from workbench.errors import InputError, UnknownNameError
from workbench.mu.frequency.sweep import frequency_sweep
from workbench.structure import Complex, Full, Real, Structure
from workbench.systems.frequency_grid import starting_grid

ONE = Structure([Full(1, 1)])


@pytest.mark.parametrize("damping", [1e-1, 1e-3, 1e-5])
def test_a_narrow_peak_is_found_and_resolved(damping):
    swept = frequency_sweep(control.tf(1, [1, 2 * damping, 1]), ONE)
    assert swept.upper.max() == pytest.approx(1 / (2 * damping * np.sqrt(1 - damping**2)), rel=2e-3)
    inner = swept.upper[1:-1]
    change = np.abs(np.diff(np.log(inner)))
    large = np.minimum(inner[1:], inner[:-1]) > 2e-3 * inner.max()
    assert change[large].max() < 0.21


def test_bounds_and_multipliers_have_the_shapes_of_the_structure():
    rng = np.random.default_rng(1)
    structure = Structure([Real(2), Full(2, 1), Complex(1)])
    system = control.ss(
        -np.diag([1.0, 2.0, 30.0]), rng.normal(size=(3, 5)), rng.normal(size=(4, 3)), 0
    )
    swept = frequency_sweep(system, structure, omega=[0.0, 1.0, 10.0, np.inf])
    assert swept.omega.tolist() == [0.0, 1.0, 10.0, np.inf]
    assert swept.M.shape == (4, 4, 5)
    assert swept.D_left.shape == (4, 4, 4)
    assert swept.D_right.shape == (4, 5, 5)
    assert swept.G.shape == swept.Delta.shape == (4, 5, 4)
    assert (swept.lower <= swept.upper * (1 + 1e-9)).all()
    assert swept.upper[-1] == pytest.approx(0, abs=1e-9)


def test_the_grid_has_zero_infinity_and_every_pole():
    poles = np.array([-1e-3, -5e4, -0.1 + 100j, -0.1 - 100j])
    grid = starting_grid(poles)
    assert grid[0] == 0.0
    assert grid[-1] == np.inf
    assert (np.diff(grid) > 0).all()
    assert all(np.abs(grid / abs(pole) - 1).min() < 1e-12 for pole in poles)
    assert ((np.abs(grid - 100) < 0.11).sum()) >= 5


@pytest.mark.parametrize("omega", [[], [-1.0], [np.nan]])
def test_wrong_frequencies(omega):
    with pytest.raises(InputError, match="omega"):
        frequency_sweep(control.tf(1, [1, 1]), ONE, omega=omega)


def test_a_system_of_another_size():
    with pytest.raises(InputError, match="structure"):
        frequency_sweep(control.tf(1, [1, 1]), Structure([Full(2, 2)]))


def test_an_unknown_method_is_named_without_a_gap_too():
    structure = Structure([Full(1, 1)])
    with pytest.raises(UnknownNameError, match="guess"):
        frequency_sweep(control.ss(-1.0, 1.0, 1.0, 0.0), structure, omega=[0.0, 1.0], lower="guess")
