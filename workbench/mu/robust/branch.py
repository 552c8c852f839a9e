"""Branch and bound on the real blocks: bounds of mixed mu as close as asked.

To prove mu <= t, show that no Delta of size 1 / t makes I - M Delta singular. The box of the real
blocks of Delta is cut into parts. In a part with centre C and half-widths R, Delta = C + R E, where
E has the structure and a size of at most 1, and

    det(I - M Delta) = det(I - M C) det(I - (I - M C)^-1 M R E).

An upper bound below 1 of the recentred matrix (I - M C)^-1 M R therefore excludes the part, and a
lower bound of the same matrix gives a Delta that makes I - M Delta singular. The levels t descend
from the upper to the lower bound.

Source: M. Newlin and P. Young, "Mixed mu problems and branch and bound techniques", CDC 1992.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from numbers import Real as Number
from typing import Any

import numpy as np

from workbench.answer import Answer, RepeatedChecker
from workbench.certificate import Check, relative_excess
from workbench.certify.agreement import need_agreement
from workbench.certify.balls import balls
from workbench.certify.singularity import proven_bound, said
from workbench.errors import InputError
from workbench.input_checks import as_matrices, need_count
from workbench.mu.boxes.partition import NARROWEST_WIDTH
from workbench.mu.boxes.recentred import real_perturbation
from workbench.mu.lower.bound import lower_bound
from workbench.mu.lower.methods import proposals
from workbench.mu.upper.bound import upper_bound
from workbench.second_opinion.peaks import NEARLY_SINGULAR, not_encircled, regularity
from workbench.solvers import Options
from workbench.structure import Real, Structure

PARTS_AT_ONCE = 32
"""Number of parts whose bounds are computed together. Half or double changes the time, and the
order of parts by little.
"""
RECENTRING_ROUNDING = 1e-9
"""Allowance for rounding errors of recentred matrices: their bounds must be below 1 by at least
this. Recentred matrices lose six digits at `LEAST_RECIPROCAL_CONDITION`, and keep ten. With half of
it they must keep more; double loosens bounds by 1e-9.
"""
LEAST_RECIPROCAL_CONDITION = 1e-6
"""Least reciprocal condition number of I - M C at which a part is recentred. Ten of sixteen digits
remain. With half of it a third of a digit less remains; with double of it more parts are cut where
they might be bounded.
"""
PARTS_EXCLUDED = "multipliers exclude every part of the box of real blocks"
"""What upper bounds rest on."""

Upper = Callable[[np.ndarray, Structure], Any]
"""An upper bound of mu for matrices (B, columns, rows): an object with ``value`` (B,)."""


@dataclass(frozen=True, repr=False)
class MuBounds(Answer):
    """Bounds ``lower`` and ``upper`` of mu of one matrix.

    ``Delta`` (rows, columns) is no larger than 1 / lower and proves that bound; where ``lower`` is
    0 it is NaN. ``nodes`` is the number of parts bounded.
    """

    lower: float
    upper: float
    Delta: np.ndarray
    nodes: int

    @property
    def gap(self) -> float:
        """Upper over lower bound, less 1; 0 where both are 0."""
        if self.upper <= self.lower:
            return 0.0
        return self.upper / self.lower - 1 if self.lower > 0 else np.inf


def branch_and_bound(
    M: Any,
    structure: Structure,
    *,
    tolerance: float = 0.05,
    nodes: int = 2000,
    upper: Upper | None = None,
    options: Options | None = None,
) -> MuBounds:
    """Bounds of mixed mu of one matrix, as close as asked or as the number of nodes allows.

    Cutting the box closes the gap that real blocks cause. The gap that complex blocks cause stays.
    Where mu of real blocks is 0, the lower bound stays 0 and the gap is infinite.

    Parameters
    ----------
    M
        Complex or real (columns, rows), finite.
    structure
        The blocks of Delta.
    tolerance
        Wanted upper / lower - 1.
    nodes
        Largest number of parts whose bounds may be computed.
    upper
        Function that computes upper bounds; `upper_bound` by default.

    Raises
    ------
    InputError
        M is not one finite matrix that fits the structure, or tolerance or nodes is not positive.
    ContradictionError
        The lower bound is above the upper one.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.mu import branch_and_bound
    >>> from workbench.structure import Complex, Real, Structure
    >>> structure = Structure([Real(1), Complex(1)])
    >>> M = np.array([[0.5, 0.2j], [0.3, 0.4]])
    >>> found = branch_and_bound(M, structure, tolerance=0.01)
    >>> bool(found.lower <= found.upper <= 1.02 * found.lower)
    True
    """
    M = as_matrices(M, structure)
    if M.ndim != 2:
        raise InputError(f"one matrix (columns, rows) is needed, M has shape {M.shape}")
    if not (isinstance(tolerance, Number) and 0.0 < tolerance < np.inf):
        raise InputError(f"tolerance is {tolerance!r}; it must be a number, positive and finite")
    need_count("nodes", nodes)
    search = _Search(M, structure, upper or upper_bound, nodes, options)
    if any(isinstance(block, Real) for block in structure):
        while search.upper > (1 + tolerance) * search.lower and search.nodes < nodes:
            # Try coarse levels first, so that there is a result if the budget ends. The last level
            # lies a little below the wanted gap, so that rounding errors do not exceed it.
            level = max(
                (1 + 0.999 * tolerance) * search.lower, np.sqrt(search.lower * search.upper)
            )
            level = level or 0.5 * search.upper
            if not search.lower < level < search.upper or not search.decide(level):
                break
    need_agreement(search.lower, search.upper, upper_claim=PARTS_EXCLUDED)
    again = partial(
        branch_and_bound,
        M,
        structure,
        tolerance=tolerance,
        nodes=nodes,
        upper=upper,
        options=options,
    )
    found = MuBounds(search.lower, search.upper, search.Delta, search.nodes)
    return found.with_checker(MatrixChecker(again, "for this one matrix", M, structure))


@dataclass(frozen=True, eq=False)
class MatrixChecker(RepeatedChecker):
    """Computes the `MuBounds` of one matrix again, and checks that its perturbation makes I - M
    Delta singular.
    """

    M: np.ndarray
    structure: Structure

    def checks(self, answer: MuBounds, tolerance: float) -> list[Check]:
        found, proven = super().checks(answer, tolerance), 0.0
        if answer.lower > 0:
            proven = proven_bound(balls(self.M), self.structure, answer.Delta)
        statement = "claimed lower bound over what its perturbation proves, less 1"
        beyond = relative_excess(answer.lower, proven)
        return [*found, Check("proof", statement, beyond, 0.0, proven=True)]

    def second_opinion(self, answer: MuBounds) -> list[Check]:
        found = [not_encircled(self.M[None] / (answer.upper or 1.0), self.structure)]
        if answer.lower == 0:
            return found
        statement = "smallest singular value of I - M Delta, balanced, relative to M Delta"
        distance = regularity(self.M @ answer.Delta)
        return [*found, Check("nearly singular", statement, distance, NEARLY_SINGULAR)]


class _Search:
    """The bounds so far, and the parts bounded for them."""

    def __init__(
        self,
        M: np.ndarray,
        structure: Structure,
        upper: Upper,
        budget: int,
        options: Options | None,
    ) -> None:
        self._M, self._structure, self._bound = M, structure, upper
        self._exact = balls(M)
        self._budget, self._options = budget, options
        self._real = [k for k, block in enumerate(structure) if isinstance(block, Real)]
        first = lower_bound(M, structure, options=options)
        self.lower, self.Delta = float(first.value), first.Delta
        self.upper = float(np.asarray(upper(M[None], structure).value)[0])
        self.nodes = 1

    def decide(self, level: float) -> bool:
        """Lower the upper bound to a level, or raise the lower bound to it; False if neither is
        possible.
        """
        count = len(self._real)
        parts = [(np.zeros(count), np.full(count, 1 / level))]
        while parts:
            if self.nodes >= self._budget:
                return False
            # Depth first, so that the list of open parts stays short.
            batch, parts = parts[-PARTS_AT_ONCE:], parts[:-PARTS_AT_ONCE]
            centres, widths = (np.array(values) for values in zip(*batch, strict=True))
            N, regular = self._recentred(centres, widths, level)
            self.nodes += len(batch)
            values = np.asarray(self._bound(N, self._structure).value)
            open_ = ~regular | ~(values < 1 - RECENTRING_ROUNDING)
            usable = open_ & regular
            self._lower_from(N[usable], centres[usable], widths[usable], level)
            if self.lower >= level:
                return True
            for index in np.flatnonzero(open_):
                halves = self._cut(N[index], centres[index], widths[index], level)
                if not halves:
                    return False
                parts += halves
        self.upper = level
        return True

    def _recentred(
        self, centres: np.ndarray, widths: np.ndarray, level: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """(I - M C)^-1 M R of each part, and whether its centre is regular (else M R)."""
        columns = len(self._M)
        loop = np.eye(columns) - self._M @ real_perturbation(self._structure, centres)
        regular = np.linalg.cond(loop) < 1 / LEAST_RECIPROCAL_CONDITION
        loop[~regular] = np.eye(columns)
        return np.linalg.solve(loop, self._M * self._scale(widths, level)[:, None, :]), regular

    def _scale(self, widths: np.ndarray, level: float) -> np.ndarray:
        """The diagonal of R of each part, (B, rows)."""
        scale = np.full((len(widths), self._structure.rows), 1 / level)
        for j, k in enumerate(self._real):
            scale[:, self._structure.row_slices[k]] = widths[:, j, None]
        return scale

    def _lower_from(
        self, N: np.ndarray, centres: np.ndarray, widths: np.ndarray, level: float
    ) -> None:
        """Raise the lower bound, if a lower bound of a recentred matrix N allows it."""
        if not len(N):
            return
        found = proposals(N, self._structure, "power", self._options)
        shifted = self._scale(widths, level)[:, :, None] * found.Delta
        Deltas = (real_perturbation(self._structure, centres) + shifted)[found.value > 0]
        sizes = np.linalg.norm(Deltas, 2, axis=(-2, -1))
        for k in np.argsort(sizes):
            if not 1 / sizes[k] > self.lower:
                return
            proven = proven_bound(self._exact, self._structure, Deltas[k])
            value = min(said(proven), float(1 / sizes[k]))
            if value > self.lower:
                self.lower, self.Delta = value, Deltas[k]

    def _cut(
        self, N: np.ndarray, centre: np.ndarray, width: np.ndarray, level: float
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """The halves of a part, cut in the most influential block; none if it is too narrow."""
        effects = [
            np.linalg.norm(N[:, self._structure.row_slices[k]])
            * np.linalg.norm(N[self._structure.column_slices[k]])
            for k in self._real
        ]
        effect = np.where(width * level > NARROWEST_WIDTH, effects, -1.0)
        j = int(np.argmax(effect))
        if effect[j] < 0:
            return []
        half = np.zeros_like(width)
        half[j] = width[j] / 2
        return [(centre + half, width - half), (centre - half, width - half)]
