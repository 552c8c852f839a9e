"""Lower bounds of mu at one frequency, proven: some structured Delta is exactly singular.

A method proposes a Delta that makes I - M Delta nearly singular. That alone proves nothing: the
nearest singular matrix may have another structure, or need a real block to be complex. The proofs
here show in ball arithmetic that a Delta* of the structure makes I - M Delta* exactly singular, and
bound the norms of its blocks from above. With v = Delta* z and z = M v != 0 they are:

  dyads         any v gives v_i = Delta_i z_i with Delta_i = v_i z_i^H / |z_i|^2, where no block is
                real or repeated;
  sign change   for real M and Delta, det(I - t M Delta) changes its sign near t = 1;
  nearest root  f(s) = det(I - M (Delta_real + s Delta_complex)) has at most m roots, and as
                f'(s) / f(s) is the sum of 1 / (s - root), one is within m |f(s) / f'(s)| of s;
  Krawczyk      v_i = delta_i z_i in the real and repeated blocks, with as many of the unknowns
                (v, delta) left free as there are equations; the others keep their values.

Sources: J. Doyle, "Analysis of feedback systems with structured uncertainties", IEE Proc. D 129
(1982) 242-250, for dyads; R. Krawczyk, Computing 4 (1969) 187-201, and S. Rump, "Verification
methods", Acta Numerica 19 (2010), theorem 13.3, for a zero within a box.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from flint import arb, ctx
from numpy.typing import NDArray
from scipy.linalg.lapack import dgebal, zgebal

from workbench._core.arrays import Array, RealArray
from workbench.certify.balls import (
    Matrix,
    above,
    balls,
    below,
    identity,
    middle,
    norm_of_block,
    submatrix,
)
from workbench.certify.krawczyk import zero_within
from workbench.certify.modes.modal_form import PRECISIONS
from workbench.certify.tied_blocks import TiedEquations, is_tied, length_of, upper_ends
from workbench.structure import Full, Real, Structure

REPROOF_MARGIN = 2.0**-36
"""A reported bound lies below the proven one by this share. The proof starts from a vector that
another processor or linear algebra library rounds differently. It is 65,536 roundings of a double.
With half of it a run may be refused on another machine; double lowers bounds by 3e-11.
"""
WIDTHS = (2.0**-46, 2.0**-34, 2.0**-20)
"""Relative distances from a proposed Delta at which a singular one is searched for. The first is 64
roundings of a double, as for well-conditioned loops; the last still leaves six digits. Half or
double: bounds are lower by as much less or more.
"""
UNUSED_SHARE = 1e-9
"""Blocks with a smaller share of the null vector, in balanced coordinates, are also tried as 0.
Rounding leaves 1e-15 or so in blocks without influence. Half or double changes which Deltas are
tried in addition.
"""
ROOT_REACH = 4
"""A root is near if the proof reaches it within this number of widths, times the number of roots; a
simple root at 1 needs one width. With half of it proofs at multiple roots go on to a wider search,
or fail; with double of it a root farther away may be taken, which lowers the bound. Both are
proven.
"""


def proven_bounds(M: Array, structure: Structure, Delta: Array) -> RealArray:
    """Lower bounds of mu (...) that Deltas prove; 0: not proven.

    Parameters
    ----------
    M
        Complex, shape (..., c, r).
    Delta
        Proposals (..., r, c) of the structure, nearly singular; not finite if there is no proposal.
    """
    value = np.zeros(M.shape[:-2])
    for index in np.ndindex(value.shape):
        if np.isfinite(Delta[index]).all():
            value[index] = proven_bound(balls(M[index]), structure, Delta[index])
    return value


def proven_bound(M: Matrix, structure: Structure, Delta: Array) -> float:
    """The lower bound of mu of every member of M (c, r) that Delta (r, c) proves; 0: not proven."""
    sizes = singular_sizes(M, structure, Delta)
    if sizes is None or not sizes.max() > 0:
        return 0.0
    return max(below(arb(1) / arb(float(sizes.max()))), 0.0)


def said(bound: Any) -> Any:
    """Proven bounds, lowered a little so that any machine can prove them again."""
    return (1 - REPROOF_MARGIN) * bound


def singular_sizes(M: Matrix, structure: Structure, Delta: Array) -> RealArray | None:
    """Upper bounds of the norms of the blocks of a Delta* near Delta with I - M Delta* singular.

    None if no proof succeeds. For a matrix of balls, each member has such a Delta*.
    """
    Delta = structured_part(structure, Delta)
    v = _direction(middle(M), Delta)
    if v is None:
        return None
    for bits in PRECISIONS:
        with ctx.workprec(bits):
            found = [sizes for sizes in _proofs(M, structure, Delta, *v) if sizes is not None]
        if found:
            return min(found, key=max)
    return None


def _proofs(
    M: Matrix, structure: Structure, Delta: Array, v: Array, share: RealArray
) -> list[RealArray | None]:
    """Sizes proven with all blocks that v uses, and with only the clearly used ones."""
    weights = np.array([np.linalg.norm(share[c]) for c in structure.column_slices])
    used = np.array([bool(v[r].any()) for r in structure.row_slices])
    choices = [used, used & (weights > UNUSED_SHARE)]
    found = []
    for which in choices[: 1 + (choices[0] != choices[1]).any()]:
        sizes = _with_blocks(M, structure, Delta, v, which) if which.any() else None
        if sizes is not None:
            every = np.zeros(len(structure))
            every[which] = sizes
            sizes = every
        found.append(sizes)
    return found


def _with_blocks(
    M: Matrix, structure: Structure, Delta: Array, v: Array, which: NDArray[np.bool_]
) -> RealArray | None:
    """Sizes of the blocks of a singular Delta* in which only some blocks are nonzero."""
    if which.all():
        problem = _Proposal(M, structure, Delta, v)
    else:
        numbers = np.flatnonzero(which)
        rows, columns = np.array(structure.row_slices), np.array(structure.column_slices)
        r = np.concatenate([np.arange(s.start, s.stop) for s in rows[numbers]])
        c = np.concatenate([np.arange(s.start, s.stop) for s in columns[numbers]])
        blocks = Structure(structure.blocks[k] for k in numbers)
        problem = _Proposal(submatrix(M, c, r), blocks, Delta[np.ix_(r, c)], v[r])
    proofs = (
        problem.dyads,
        problem.sign_change,
        problem.nearest_root,
        problem.krawczyk,
        problem.root_farther_away,
    )
    for proof in proofs:
        try:
            sizes = proof()
        except ZeroDivisionError:  # ball arithmetic cannot tell the matrix from a singular one
            continue
        if sizes is not None and np.isfinite(sizes).all():
            return sizes
    return None


@dataclass(frozen=True, eq=False)
class _Proposal:
    """M (c, r), the structure, a nearly singular Delta (r, c) and v = Delta z (r,)."""

    M: Matrix
    structure: Structure
    Delta: Array
    v: Array

    @property
    def norms(self) -> list[arb]:
        """Upper bounds of the norms of Delta's blocks."""
        places = zip(self.structure.row_slices, self.structure.column_slices, strict=True)
        return [norm_of_block(self.Delta[place]) for place in places]

    @property
    def real(self) -> bool:
        """Whether M and Delta are exactly real."""
        entries = chain.from_iterable(self.M.tolist())
        return not self.Delta.imag.any() and all(entry.imag.is_zero() for entry in entries)

    def dyads(self) -> RealArray | None:
        """|v_i| / |z_i|, if no block is real or repeated."""
        if any(is_tied(block) for block in self.structure):
            return None
        v = balls(self.v[:, None])
        z = self.M * v
        places = zip(self.structure.row_slices, self.structure.column_slices, strict=True)
        return upper_ends(length_of(v, row) / length_of(z, column) for row, column in places)

    def sign_change(self) -> RealArray | None:
        """Sizes at 1 + width, where det(I - t M Delta) changes its sign at 1 - width < t."""
        if not self.real:
            return None
        product = (self.M * balls(self.Delta)).real
        one = identity(product.nrows()).real
        for width in WIDTHS:
            low, high = ((one - arb(t) * product).det() for t in (1 - width, 1 + width))
            if low * high < 0:
                return upper_ends(arb(1 + width) * norm for norm in self.norms)
        return None

    def nearest_root(self) -> RealArray | None:
        """Sizes with the complex blocks scaled by a root of f next to 1, if that root is simple.

        This proof is cheaper than a box; if real blocks nearly suffice, the box is the sharper
        proof.
        """
        return self._scaled_sizes(WIDTHS[:1], WIDTHS[0])

    def root_farther_away(self) -> RealArray | None:
        """Sizes as `nearest_root`, if a multiple root or rounding has moved the root away from
        1.
        """
        return self._scaled_sizes(WIDTHS, WIDTHS[-1])

    def _scaled_sizes(self, widths: tuple[float, ...], reachable: float) -> RealArray | None:
        """Sizes with the complex blocks scaled by a root of f, with modulus at most |s|.

        f is evaluated at the distances `widths` from 1; a root is searched for up to a few times
        `reachable` from there.
        """
        scaled = np.zeros_like(self.Delta)
        turns = [not isinstance(block, Real) for block in self.structure]
        places = zip(self.structure.row_slices, self.structure.column_slices, strict=True)
        for turn, place in zip(turns, places, strict=True):
            if turn:
                scaled[place] = self.Delta[place]
        # The degree of f is at most the rank of its last term.
        m = min(
            sum(b.rows for b, turn in zip(self.structure, turns, strict=True) if turn),
            sum(b.columns for b, turn in zip(self.structure, turns, strict=True) if turn),
        )
        if m == 0:
            return None
        free = self.M * balls(scaled)
        held = identity(self.M.nrows()) - self.M * balls(self.Delta - scaled)
        best: arb | None = None
        for width in widths:
            s = arb(1 + width)
            change = abs((held - s * free).solve(free).trace())  # |f'(s) / f(s)|
            if not change > 0:
                continue
            reach = arb(int(m)) / change
            best = s + reach if best is None or s + reach < best else best
            if reach < ROOT_REACH * m * width:
                break
        if best is None or not best < 1 + (1 + ROOT_REACH * m) * reachable:
            return None
        return upper_ends(
            norm * best if turn else norm for norm, turn in zip(self.norms, turns, strict=True)
        )

    def krawczyk(self) -> RealArray | None:
        """Sizes within a box of (v, delta) that contains a zero of v_i - delta_i z_i."""
        if not any(isinstance(block, Real) for block in self.structure):
            return None  # for complex blocks alone, roots are as good and cheaper
        equations = TiedEquations(self.M, self.structure, self.real)
        start = equations.unknowns(self.v, self.Delta)
        box = zero_within(start, equations.residual, equations.jacobian)
        return None if box is None else equations.sizes(box)


def size_of(structure: Structure, Delta: Array) -> float:
    """An upper bound of the largest singular value of a Delta (r, c) of the structure."""
    places = zip(structure.row_slices, structure.column_slices, strict=True)
    return max(above(norm_of_block(Delta[place])) for place in places)


def structured_part(structure: Structure, Delta: Array) -> Array:
    """The Delta of exactly this structure nearest to the given blocks; scalars by their first
    entry.
    """
    exact = np.zeros(Delta.shape, complex)
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        first = Delta[row.start, column.start]
        if isinstance(block, Full):
            exact[row, column] = Delta[row, column]
        else:
            np.fill_diagonal(exact[row, column], first.real if isinstance(block, Real) else first)
    return exact


def _direction(M: Array, Delta: Array) -> tuple[Array, RealArray] | None:
    """v = Delta z for the z with the least |(I - M Delta) z|, and the balanced sizes of z.

    This starts the proofs; how well it is computed decides only whether they succeed.
    """
    with np.errstate(all="ignore"):
        loop = M @ Delta
        if not (np.isfinite(loop).all() and loop.any()):
            return None
        loop, balance = (loop, zgebal) if loop.imag.any() else (loop.real, dgebal)
        balanced, _, _, frame, _ = balance(loop, scale=1)
        if not np.isfinite(balanced).all():
            return None
        x = np.linalg.svd(np.eye(len(loop)) - balanced)[2][-1].conj()
        v = Delta @ (frame * x)
    return (v, np.abs(x)) if np.isfinite(v).all() else None
