"""The equations of real and repeated blocks: their derivatives, and the sizes that they prove."""

import numpy as np
import pytest
from flint import arb

from workbench.certify.balls import balls
from workbench.certify.tied_blocks import TiedEquations, is_tied
from workbench.structure import Complex, Full, Real, Structure

STRUCTURE = Structure([Full(1, 2), Real(2), Complex(2), Complex(1), Full(2, 1)])
REAL = Structure([Real(2), Real(1), Full(1, 1)])


def equations(structure, real):
    """The equations of a random matrix, and unknowns near nothing in particular."""
    rng = np.random.default_rng(7)
    M, size = rng.standard_normal((structure.columns, structure.rows)), structure.rows
    v, d = rng.standard_normal(size), rng.standard_normal(len(structure))
    if not real:
        M = M + 1j * rng.standard_normal(M.shape)
        v = v + 1j * rng.standard_normal(size)
    Delta = np.zeros((structure.rows, structure.columns), complex)
    for k, block in enumerate(structure):
        turn = 0.3j if isinstance(block, Complex) else 0.0
        Delta[structure.row_slices[k], structure.column_slices[k]] = (d[k] + turn) * np.eye(
            block.rows, block.columns
        )
    found = TiedEquations(balls(M), structure, real)
    return found, found.unknowns(v, Delta)


@pytest.mark.parametrize(("structure", "real"), [(STRUCTURE, False), (REAL, True), (REAL, False)])
def test_derivatives_are_those_of_the_left_sides(structure, real):
    """The left sides are quadratic, so that central differences of any step are their slopes."""
    found, unknowns = equations(structure, real)
    table = found.jacobian(unknowns)
    for column in range(len(unknowns)):
        up, down = (
            found.residual([x + step * (k == column) for k, x in enumerate(unknowns)])
            for step in (arb(0.5), arb(-0.5))
        )
        for row, (high, low) in enumerate(zip(up, down, strict=True)):
            assert abs(float(high - low) - float(table[row][column])) < 1e-12, (row, column)


def test_a_box_proves_the_sizes_of_its_blocks():
    """v = (1, 2, 3) with z = M v = (2, 4, 6) of Delta = 0.5: a tied block and a full one."""
    structure = Structure([Real(2), Full(1, 1)])
    found = TiedEquations(balls(2 * np.eye(3)), structure, True)
    unknowns = found.unknowns(np.array([1.0, 2.0, 3.0]), 0.5 * np.eye(3))
    assert [float(x) for x in found.residual(unknowns)] == [0.0, 0.0]
    assert found.sizes(unknowns) == pytest.approx([0.5, 0.5], rel=1e-12)


def test_a_box_that_holds_zero_proves_nothing():
    structure = Structure([Real(1), Real(1)])
    found = TiedEquations(balls(np.eye(2)), structure, True)
    nothing = found.unknowns(np.zeros(2), np.eye(2))
    assert found.sizes(nothing) is None
    wide = [arb(0, 1e-3), arb(0, 1e-3), *nothing[2:]]
    assert found.sizes(wide) is None


def test_what_ties():
    tied = [Real(1), Real(2), Complex(2), Complex(3)]
    free = [Complex(1), Full(1, 1), Full(2, 3)]
    assert all(map(is_tied, tied)) and not any(map(is_tied, free))
