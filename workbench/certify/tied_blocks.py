"""Equations of the blocks of a singular Delta whose values are tied: v_i = delta_i z_i, z = M v.

A full block and a complex scalar that is not repeated tie nothing: for any v_i and z_i != 0 there
is a block of norm |v_i| / |z_i| that maps z_i to v_i.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from flint import acb, acb_mat, arb

from workbench._core.arrays import Array, RealArray
from workbench.certify.balls import Matrix, above, length
from workbench.structure import Block, Full, Real, Structure


def is_tied(block: Block) -> bool:
    """Whether a block's values are tied to each other or to the real axis."""
    return isinstance(block, Real) or (not isinstance(block, Full) and block.rows > 1)


def length_of(vector: Matrix, some: slice) -> arb:
    """Length of a part of a column vector."""
    return length([vector[i, 0] for i in range(some.start, some.stop)])


def upper_ends(norms: Iterable[arb]) -> RealArray:
    """Upper ends of the balls."""
    return np.array([above(norm) for norm in norms])


class TiedEquations:
    """v_i - delta_i M_i v = 0 for the real and repeated blocks i, as real equations.

    The unknowns are the real and the imaginary parts of v and of the deltas; without the imaginary
    parts where everything is real. Imaginary parts of real scalars do not exist.
    """

    def __init__(self, M: Matrix, structure: Structure, real: bool) -> None:
        self.M, self.structure, self.real = M, structure, real
        self.tied = [k for k, block in enumerate(structure) if is_tied(block)]
        self.turning = [
            k for k in self.tied if not real and not isinstance(structure.blocks[k], Real)
        ]

    def unknowns(self, v: Array, Delta: Array) -> list[arb]:
        """The unknowns of a proposed v and Delta."""
        delta = {
            k: Delta[self.structure.row_slices[k].start, self.structure.column_slices[k].start]
            for k in self.tied
        }
        numbers = [
            *v.real,
            *([] if self.real else v.imag),
            *(delta[k].real for k in self.tied),
            *(delta[k].imag for k in self.turning),
        ]
        return [arb(float(number)) for number in numbers]

    def _parts(self, unknowns: list[arb]) -> tuple[Matrix, dict[int, acb], Matrix]:
        """v (r, 1), the deltas by block, and z = M v (c, 1)."""
        values, n = iter(unknowns), self.structure.rows
        re = [next(values) for _ in range(n)]
        im = [arb(0) if self.real else next(values) for _ in range(n)]
        first = {k: next(values) for k in self.tied}
        second = {k: next(values) for k in self.turning}
        delta = {k: acb(first[k], second.get(k, arb(0))) for k in self.tied}
        v = acb_mat([[acb(*entry)] for entry in zip(re, im, strict=True)])
        return v, delta, self.M * v

    def _each(self) -> list[tuple[int, int, int]]:
        """Block, row of Delta and column of Delta of each complex equation."""
        s = self.structure
        return [
            (k, s.row_slices[k].start + i, s.column_slices[k].start + i)
            for k in self.tied
            for i in range(s.blocks[k].rows)
        ]

    def residual(self, unknowns: list[arb]) -> list[arb]:
        """Left sides of the real equations."""
        v, delta, z = self._parts(unknowns)
        left = [v[i, 0] - delta[k] * z[j, 0] for k, i, j in self._each()]
        return [x.real for x in left] + ([] if self.real else [x.imag for x in left])

    def jacobian(self, unknowns: list[arb]) -> list[list[arb]]:
        """Derivatives of the left sides (rows) with respect to the unknowns (columns)."""
        _, delta, z = self._parts(unknowns)
        table = []
        for k, i, j in self._each():
            by_v = [int(i == q) - delta[k] * self.M[j, q] for q in range(self.structure.rows)]
            by_delta = {k: -z[j, 0]}
            row = [*by_v, *([] if self.real else [1j * one for one in by_v])]
            row += [by_delta.get(q, acb(0)) for q in self.tied]
            row += [1j * by_delta.get(q, acb(0)) for q in self.turning]
            table.append(row)
        halves = [[[x.real for x in row] for row in table]]
        if not self.real:
            halves.append([[x.imag for x in row] for row in table])
        return [row for half in halves for row in half]

    def sizes(self, box: list[arb]) -> RealArray | None:
        """Upper bounds of the norms of the blocks within a box; None if v may be 0."""
        v, delta, z = self._parts(box)
        if not any(abs(v[i, 0]) > 0 for i in range(self.structure.rows)):
            return None
        places = zip(self.structure.row_slices, self.structure.column_slices, strict=True)
        return upper_ends(
            abs(delta[k]) if k in delta else length_of(v, row) / length_of(z, column)
            for k, (row, column) in enumerate(places)
        )
