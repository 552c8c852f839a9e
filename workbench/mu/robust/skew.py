"""The skewed structured singular value: some blocks have a size of at most 1, the others vary.

    nu(M) = 1 / min{ size of the varying blocks : fixed blocks at most 1, I - M Delta singular }

Let S(b) = diag(I, I / b) divide the columns of M that belong to varying blocks by b. Then
f(b) = mu(M S(b)) does not increase with b, and b f(b) does not decrease: log f over log b has
slopes in [-1, 0]. nu is the b with f(b) = 1.

Source: M. Fan and A. Tits, "A measure of worst-case H-infinity performance and of largest
acceptable uncertainty", Systems & Control Letters 18 (1992) 409-421.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import Array, RealArray
from workbench.answer import Answer
from workbench.certificate import Check, Checker, counted_quantifier, relative_excess
from workbench.certify.agreement import need_agreement
from workbench.certify.singularity import said
from workbench.certify.skewed import proven_skew
from workbench.errors import InputError, SolverError, UnknownNameError
from workbench.input_checks import as_list, as_matrices
from workbench.mu.lower.methods import proposals
from workbench.mu.upper.bound import upper_bound
from workbench.second_opinion.peaks import NEARLY_SINGULAR, not_encircled, regularity
from workbench.structure import Structure

UPPER_ROOT_WIDTH = 1e-7
"""Width of the interval of log b in which the root of the upper bound is found; the noise of the
upper bound is smaller. With half of it the noise decides the last step; double changes the seventh
digit.
"""
LOWER_ROOT_WIDTH = 1e-5
"""Width of the interval of log b in which the root of the lower bound is found. It is a tenth of
what `SUFFICIENT_SHARE` leaves. With half of it each takes a step more; double loosens bounds by
1e-5.
"""
UPPER_ROOT_STEPS = 40
"""Largest number of evaluations of the upper bound in the search for its root. A search ends
earlier by `UPPER_ROOT_WIDTH`. With half of them some roots keep a looser bound; double costs time
only.
"""
SUFFICIENT_SHARE = 0.9999
"""A lower bound above this share of the upper bound is not improved further. Nobody needs the fifth
digit. With half of the distance from 1 the thorough bound, twenty times slower, runs more often;
double leaves gaps of 2e-4.
"""
LARGEST_LOOP_CONDITION = 1e10
"""Largest condition number of I - M Delta_f for which the loop of Delta_f is closed. Six digits
remain then. Half or double moves this border by a third of a digit.
"""
ROOT_SEARCH_RANGE = 80.0
"""Largest distance from the start, in log b, at which a root is searched for. exp(80) is 5e34.
Farther away a bound is 0 or infinite in doubles. Half still holds any system in usual units; double
changes nothing.
"""
OUTWARD_FACTOR = 1 + 1e-13
"""Factor that rounds products of proven numbers outward. It is 450 roundings, and a product has a
few. Half or double changes the thirteenth digit.
"""


@dataclass(frozen=True, eq=False, repr=False)
class SkewBounds(Answer):
    """Bounds of the skewed structured singular value, as arrays over the batch.

    ``lower`` (...) and ``upper`` (...). ``Delta`` (..., r, c) proves the lower bound: its fixed
    blocks are at most 1, its varying blocks at most 1 / lower, and I - M Delta is singular up to
    rounding. Delta is NaN where lower is 0. Where lower is infinite the varying blocks are 0,
    because the fixed blocks alone make I - M Delta singular.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.mu import skew_bounds
    >>> from workbench.structure import Complex, Real, Structure
    >>> structure = Structure([Real(1), Complex(1)])
    >>> M = np.array([[0.5, 0.2j], [0.3, 0.4]])
    >>> skew_bounds(M, structure, fixed=[0]).Delta.shape
    (2, 2)
    """

    lower: RealArray
    upper: RealArray
    Delta: Array


def skew_bounds(M: Any, structure: Structure, fixed: Sequence[str | int] | str | int) -> SkewBounds:
    """Bounds of the skewed structured singular value for each matrix of a batch.

    Parameters
    ----------
    M
        The matrix that Delta closes, complex or real (..., columns, rows), finite.
    structure
        Blocks of Delta.
    fixed
        Names or numbers of the blocks with a size of at most 1. The others, at least one, vary.

    Returns
    -------
    SkewBounds
        Multipliers of the scaled matrix prove ``upper``; it is infinite where mu of the fixed
        blocks is not proven to be below 1. Both bounds are 0 where no varying block is in a loop.

    Raises
    ------
    InputError, UnknownNameError
        M does not fit the structure or is not finite; `fixed` has a block that the structure does
        not have; or all blocks are fixed.
    ContradictionError
        A lower bound is above the upper one.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.mu import skew_bounds
    >>> from workbench.structure import Complex, Real, Structure
    >>> structure = Structure([Real(1), Complex(1)])
    >>> M = np.array([[0.5, 0.2j], [0.3, 0.4]])
    >>> found = skew_bounds(M, structure, fixed=[0])
    >>> bool(found.lower <= found.upper)
    True
    """
    M = as_matrices(M, structure)
    varies = np.array([k not in numbers_of(structure, fixed) for k in range(len(structure))])
    if not varies.any():
        raise InputError("all blocks are fixed; leave at least one to vary, or use `upper_bound`")
    skew = Skew(M.reshape(-1, *M.shape[-2:]), structure, varies)
    upper = skew.upper()
    lower, Delta = skew.lower(upper)
    batch = M.shape[:-2]
    need_agreement(lower.reshape(batch), upper.reshape(batch), "the skewed mu")
    return SkewBounds(
        lower.reshape(batch),
        upper.reshape(batch),
        Delta.reshape(*batch, structure.rows, structure.columns),
    ).with_checker(SkewChecker(skew))


@dataclass(frozen=True, eq=False)
class SkewChecker(Checker):
    """Checks `SkewBounds` of a batch with one axis; the multipliers of the upper bound are computed
    anew.
    """

    skew: Skew

    @property
    def quantifier(self) -> str:
        return counted_quantifier(len(self.skew.M), "matrix", "matrices, between them nothing")

    def checks(self, answer: SkewBounds, tolerance: float) -> list[Check]:
        M, structure, varies = self.skew.M, self.skew.structure, self.skew.blocks
        lower, upper = np.ravel(answer.lower), np.ravel(answer.upper)
        Delta = answer.Delta.reshape(len(M), structure.rows, structure.columns)
        bounded = np.flatnonzero(np.isfinite(upper) & (upper > 0))
        mu = upper_values(self.skew.scaled(bounded, upper[bounded]), structure)
        short = [
            relative_excess(value, proven_skew(one, structure, varies, delta)) if value > 0 else 0.0
            for one, value, delta in zip(M, lower, Delta, strict=True)
        ]
        statement = "mu of the matrix with the inputs of varying blocks divided by it, less 1"
        return [
            Check("upper", statement, float(mu.max(initial=0.0)) - 1.0, UPPER_ROOT_WIDTH),
            Check(
                "lower",
                "claimed lower bound over what its perturbation proves, less 1",
                max(short, default=0.0),
                0.0,
                proven=True,
            ),
        ]

    def second_opinion(self, answer: SkewBounds) -> list[Check]:
        loops = self.skew.M @ answer.Delta.reshape(len(self.skew.M), *answer.Delta.shape[-2:])
        found = [regularity(one) for one in loops if np.isfinite(one).all()]
        statement = "smallest singular value of I - M Delta, balanced, relative to M Delta"
        distance = max(found, default=0.0)
        upper = np.ravel(answer.upper)
        finite = np.flatnonzero(np.isfinite(upper))
        largest = finite[np.argsort(-upper[finite], kind="stable")]
        scaled = self.skew.scaled(largest, np.where(upper > 0, upper, 1.0)[largest])
        return [
            Check("nearly singular", statement, distance, NEARLY_SINGULAR),
            not_encircled(scaled, self.skew.structure),
        ]


def numbers_of(structure: Structure, fixed: Sequence[str | int] | str | int) -> set[int]:
    """Indices of the blocks that `fixed` names."""
    names = [block.name for block in structure]
    numbers = set()
    several = isinstance(fixed, Iterable) and not isinstance(fixed, str | Mapping)
    for one in as_list(fixed, "fixed") if several else [fixed]:
        if isinstance(one, str):
            if names.count(one) > 1:
                raise InputError(f"{names.count(one)} blocks are called {one!r}; give their number")
            if one not in names or not one:
                raise UnknownNameError("block", one, [name for name in names if name])
            numbers.add(names.index(one))
        elif isinstance(one, bool) or not isinstance(one, Integral):
            raise InputError(f"fixed must be names or numbers of blocks, not {one!r}")
        elif not 0 <= int(one) < len(names):
            raise InputError(f"there is no block {one}; the structure has {len(names)}, from 0")
        else:
            numbers.add(int(one))
    return numbers


class Skew:
    """Bounds for finite matrices M (B, c, r); `varies` (blocks,) marks the varying blocks."""

    def __init__(self, M: Array, structure: Structure, varies: NDArray[np.bool_]) -> None:
        self.M, self.structure, self.blocks = M, structure, varies
        self.rows, self.columns = self._rows(varies), self._columns(varies)
        self.without = np.where(self.rows, 0.0, M)
        self.closable = self._loops()

    def _loops(self) -> NDArray[np.bool_]:
        """Whether a varying block is in a loop (B,); if not, det(I - M Delta) does not depend on
        them.
        """
        places = list(zip(self.structure.column_slices, self.structure.row_slices, strict=True))
        coupled = [[self.M[:, i, j].any((-2, -1)) for _, j in places] for i, _ in places]
        step = np.array(coupled, float).transpose(2, 0, 1)
        walks = step @ np.linalg.matrix_power(np.eye(len(places)) + step, len(places) - 1)
        return np.asarray(np.diagonal(walks, axis1=1, axis2=2)[:, self.blocks].any(-1), bool)

    def scaled(self, which: Array, b: RealArray) -> Array:
        """M S(b) of the matrices numbered `which`."""
        M: Array = np.where(self.rows, self.M[which] / b[:, None, None], self.M[which])
        return M

    def upper(self) -> RealArray:
        """Upper bounds (B,): the least b f(b) with a proven f(b) < 1 among the points tried.

        Multipliers that prove f(b) = v < 1 prove that nu is at most b v, because the fixed blocks
        have a size of at most 1 < 1 / v.
        """
        upper = np.where(self.closable, np.inf, 0.0)
        proper = upper_values(self.without, self.structure) < 1
        upper[~proper] = np.inf
        which = np.flatnonzero(proper & self.closable)

        def bound(some: Array, b: RealArray) -> RealArray:
            value = upper_values(self.scaled(which[some], b), self.structure)
            proven = value < 1
            place = which[some][proven]
            upper[place] = np.minimum(upper[place], OUTWARD_FACTOR * (b * value)[proven])
            return value

        _root(bound, self._start(which), UPPER_ROOT_WIDTH, UPPER_ROOT_STEPS)
        return upper

    def _start(self, which: Array) -> RealArray:
        """First value of b: mu of the varying blocks alone or, if that is 0, the norm of their
        columns.
        """
        alone = np.where(self.columns[:, None] & self.rows, self.M[which], 0.0)
        value = upper_values(alone, self.structure)
        size = np.linalg.norm(np.where(self.rows, self.M[which], 0.0), axis=(-2, -1))
        start: RealArray = np.where(value > 1e-9 * size, value, size)
        return start

    def lower(self, upper: RealArray) -> tuple[RealArray, Array]:
        """Proven lower bounds (B,) and Deltas: the largest 1 / size of varying blocks found."""
        lower = np.zeros(len(self.M))
        Delta = np.full((len(self.M), self.structure.rows, self.structure.columns), np.nan + 0j)

        def keep(place: Array, found: Array) -> None:
            proper = np.isfinite(found).all((-2, -1))
            place, found = place[proper], found[proper]
            varying, fixed = self._sizes(found)
            with np.errstate(divide="ignore", invalid="ignore"):
                promised = np.where(fixed <= 1, 1 / varying, 0.0)
            for k in np.flatnonzero(promised > lower[place]):
                one = self.M[place[k]], self.structure, self.blocks, found[k]
                value = min(said(proven_skew(*one)), promised[k])
                if value > lower[place[k]]:
                    lower[place[k]], Delta[place[k]] = value, found[k]

        unproven = np.flatnonzero(np.isinf(upper))
        if unproven.size:
            alone = self._bounded(self.M[unproven], ~self.blocks, "best")
            keep(unproven, alone)
        # The thorough bound takes twenty times as long: use it where the quick one leaves a gap.
        for method, steps in (("power", 12), ("best", 6)):
            which = np.flatnonzero(self.closable & ~(lower >= SUFFICIENT_SHARE * upper))

            def bound(
                some: Array, b: RealArray, which: Array = which, method: str = method
            ) -> RealArray:
                place = which[some]
                found = proposals(self.scaled(place, b), self.structure, method)
                Delta = np.where(self.rows[:, None], found.Delta / b[:, None, None], found.Delta)
                keep(place, Delta)
                hit = found.value > 0
                keep(place[hit], self._closed(place[hit], Delta[hit], method))
                return found.value

            start = np.where(np.isinf(upper[which]), self._start(which), upper[which])
            _root(bound, start, LOWER_ROOT_WIDTH, steps)
        return lower, Delta

    def _sizes(self, Delta: Array) -> tuple[RealArray, RealArray]:
        """Sizes of the varying and of the fixed blocks."""
        parts = np.where(self.rows[:, None], Delta, 0.0), np.where(self.rows[:, None], 0.0, Delta)
        varying, fixed = (np.linalg.norm(part, 2, axis=(-2, -1)) for part in parts)
        return varying, fixed

    def _closed(self, which: Array, Delta: Array, method: str) -> Array:
        """Deltas with fixed blocks scaled to at most 1 and the least varying blocks for these.

        The varying blocks act on (I - M Delta_f)^-1 M, where the fixed blocks Delta_f are closed.
        NaN where no varying blocks were found.
        """
        fixed = np.where(self.rows[:, None], 0.0, Delta)
        size = np.linalg.norm(fixed, 2, axis=(-2, -1))
        fixed = fixed / np.maximum(size * OUTWARD_FACTOR, 1.0)[:, None, None]
        loop = np.eye(self.structure.columns) - self.M[which] @ fixed
        regular = np.linalg.cond(loop) < LARGEST_LOOP_CONDITION
        seen = np.linalg.solve(loop[regular], self.M[which[regular]])
        result = np.full_like(fixed, np.nan)
        result[regular] = fixed[regular] + self._bounded(seen, self.blocks, method)
        return result

    def _bounded(self, M: Array, blocks: NDArray[np.bool_], method: str) -> Array:
        """The least Delta found with only some blocks, the others 0; NaN where none was found."""
        part = Structure(b for b, one in zip(self.structure, blocks, strict=True) if one)
        rows, columns = self._rows(blocks), self._columns(blocks)
        found = proposals(M[:, columns][:, :, rows], part, method)
        Delta = np.zeros((len(M), self.structure.rows, self.structure.columns), complex)
        Delta[:, rows[:, None] & columns] = found.Delta.reshape(len(M), rows.sum() * columns.sum())
        Delta[found.value == 0] = np.nan
        return Delta

    def _rows(self, blocks: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Rows of Delta that blocks take."""
        return np.repeat(blocks, [block.rows for block in self.structure])

    def _columns(self, blocks: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Columns of Delta that blocks take."""
        return np.repeat(blocks, [block.columns for block in self.structure])


def upper_values(M: Array, structure: Structure) -> RealArray:
    """Upper bounds of mu of matrices (B, c, r).

    Where the method fails for a matrix, its real scalars are treated as complex.
    """
    try:
        return upper_bound(M, structure).value
    except SolverError:
        if len(M) > 1:
            half = len(M) // 2
            return np.concatenate([upper_values(part, structure) for part in (M[:half], M[half:])])
        return upper_bound(M, structure.complexified()).value


def _root(
    bound: Callable[[Array, RealArray], RealArray], start: RealArray, close: float, steps: int
) -> None:
    """Evaluate bounds f(b) at points that approach the root f(b) = 1, for each start on its own.

    `bound(some, b)` gives the values at b (K,) for the matrices numbered `some` (K,). The slopes of
    log f over log b lie in [-1, 0], so b f(b) is always between b and the root. The search moves
    outward from there until it brackets the root. Secants then shrink the bracket to the width
    `close`; they aim alternately at either side of the root. At most `steps` evaluations.
    """
    x = np.log(start)
    first = x.copy()
    low, high = np.full_like(x, -np.inf), np.full_like(x, np.inf)
    at_low, at_high = np.zeros_like(x), np.zeros_like(x)
    stride = np.full_like(x, 0.01)
    active = np.arange(len(x))
    for step in range(steps):
        if not active.size:
            return
        with np.errstate(divide="ignore"):
            g = np.maximum(np.log(bound(active, np.exp(x[active]))), -30.0)
        above = g >= 0
        ups, downs = active[above], active[~above]
        low[ups], at_low[ups] = x[ups], g[above]
        high[downs], at_high[downs] = x[downs], g[~above]
        between = np.isfinite(low) & np.isfinite(high)
        width = np.where(between, high - low, np.inf)
        with np.errstate(invalid="ignore", divide="ignore"):
            aim = (0.25 if step % 2 else -0.25) * close
            share = (at_low - aim) / (at_low - at_high)
            # Every third step halves the bracket, because secants on a curved f may shrink little.
            share = np.where((share > 0) & (share < 1) & (step % 3 < 2), share, 0.5)
            inside = low + share * width
        outside = np.where(np.isfinite(low), low + at_low + stride, high + at_high - stride)
        x = np.where(between, inside, outside)
        stride[~between] *= 4
        active = np.flatnonzero((width > close) & (abs(x - first) < ROOT_SEARCH_RANGE))
