"""The methods of the mixed-mu lower bound."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.certify.singularity import proven_bounds, said
from workbench.executor import Context
from workbench.mu.lower.attain import block_table
from workbench.mu.lower.mixed_blocks import gain_bound, held_bound, weak_bound
from workbench.mu.lower.nonlinear import NonlinearSearch
from workbench.mu.lower.program import LowerBound, MuLowerBound
from workbench.mu.lower.real_blocks import (
    MOST_VERTICES,
    best_vertex,
    real_bound,
    sign_patterns,
    unit_starts,
)
from workbench.mu.lower.scaling import scaled_matrices, unscaled
from workbench.mu.lower.search import search_batch
from workbench.program import Claim, method
from workbench.solvers import Options, Outcome, in_one_thread
from workbench.structure import Real, Structure

FEW_STARTS, MANY_STARTS = 8, 32
"""Largest number of starts from which `"power"` and `"best"` make ascents. Most maxima are met from
eight, rare ones from 32. With half of them bounds may be smaller; double takes up to twice as long.
"""
RUN_KINDS = "MLHL"
"""Kinds of runs that lead to starts, in turn. M: power iteration in which real blocks move; H:
power iteration with held real blocks; L: search for an eigenvalue near a level, with held real
blocks.
"""
RUN_LEVELS = 0.8, 1.8
"""Levels at which an eigenvalue is searched for, as multiples of the best known one. Levels about
the known one find others beside it; levels above it find larger ones. Half or double: runs mostly
lead to the known eigenvalue, or to none.
"""
AGREEING_ASCENTS = {"mixed": 16, "complex": 8, "real": 6}
"""A search ends early once this many ascents have reached the best value, by the kinds of
blocks.
"""
FEWEST_AGREEING, AGREEING_ROWS = 3, 64
"""At least FEWEST_AGREEING ascents must agree, and for large matrices no more than AGREEING_ROWS
over the number of rows: the larger the matrix, the fewer ascents reach the same value. Ascents of
large matrices are long, so fewer must do. Half or double ends searches earlier, at smaller bounds,
or later.
"""
MOST_COMPLEX_VERTICES = 8
"""Largest number of vertices of real blocks that are searched for real eigenvalues of a complex
matrix. For complex matrices only chance makes an eigenvalue at a vertex real. With half of them a
lower bound may be smaller for some; double costs time.
"""
NONLINEAR_STARTS = 6
"""Number of random starts of the nonlinear program. The method is an independent answer. With half
of them its lower bounds may be smaller; with twice as many it takes twice as long.
"""
RUNNERS_UP = 2
"""Number of earlier proposals for a matrix that are tried if the best one cannot be proven. Their
values are lower. With half of them a matrix may be left with a lower bound of 0; double costs
memory.
"""
DEADLINE_MATRICES = 250
"""Number of matrices computed between two checks of the deadline. Half or double changes how
promptly a time limit is kept.
"""

FoundEigenvalue = tuple[float, np.ndarray]
"""A real eigenvalue of M Delta (0: none found) and its Delta."""


def _has_real(program: MuLowerBound) -> str | None:
    """Why a method for real blocks cannot take the program; None if it can."""
    if any(isinstance(block, Real) for block in program.structure):
        return None
    return "the structure has no real block; use 'power' or 'best'"


def proposals(
    M: np.ndarray, structure: Structure, method: str, options: Options | None = None
) -> LowerBound:
    """What ``"power"`` or ``"best"`` proposes for matrices (B, columns, rows), not proven.

    A proposal may be called a bound only after the kernel has proven it.
    """
    search = _Search(MuLowerBound(M, structure), Context(options=options or Options()))
    {"power": _power_search, "best": _best_search}[method](search)
    return search.proposed()


@method(MuLowerBound, "power", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _power(program: MuLowerBound, context: Context) -> Claim:
    """Local ascents from a few power iterations of Packard, Fan, Doyle and Young."""
    search = _Search(program, context)
    _power_search(search)
    return search.claim()


def _power_search(search: _Search) -> None:
    """Keep the best of the local ascents from a few starts."""
    search.ascend(FEW_STARTS, FEWEST_AGREEING)


@method(MuLowerBound, "gain", optimal=False, unfit=_has_real, accuracy=ANY_ACCURACY_ALIKE)
def _gain(program: MuLowerBound, context: Context) -> Claim:
    """Vertices and edges of the real blocks, complex ones by the gain of the loop they close."""
    search = _Search(program, context)
    search.each("gain", search.from_vertices)
    return search.claim()


@method(MuLowerBound, "ipopt", optimal=False)
@in_one_thread
def _ipopt(program: MuLowerBound, context: Context) -> Claim:
    """A nonlinear program in Delta and the singular vector, solved from random starts."""
    search = _Search(program, context)
    search.each("nonlinear program", search.from_nonlinear(context))
    return search.claim()


@method(MuLowerBound, "best", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _best(program: MuLowerBound, context: Context) -> Claim:
    """Local ascents from power iterations and, for real blocks, from vertices and edges."""
    search = _Search(program, context)
    _best_search(search)
    return search.claim()


def _best_search(search: _Search) -> None:
    """Keep the best of the local ascents from many starts."""
    real = {isinstance(block, Real) for block in search.structure}
    agree = AGREEING_ASCENTS["mixed" if len(real) == 2 else "real" if True in real else "complex"]
    agree = min(agree, max(FEWEST_AGREEING, AGREEING_ROWS // search.structure.rows))
    search.ascend(MANY_STARTS, agree)
    if real == {True}:
        search.each("vertices", search.from_exact_vertices())


class _Search:
    """The balanced matrices of a program, and the best proposals found so far for each."""

    def __init__(self, program: MuLowerBound, context: Context) -> None:
        self._program, self._context = program, context
        self.structure = program.structure
        self.table = block_table(program.structure)
        shape = program.M.shape[-2:]
        self.M, self._exponent = scaled_matrices(program.M.reshape(-1, *shape), program.structure)
        self.value = np.zeros(len(self.M))
        self.delta = np.zeros((len(self.M), *shape[::-1]), complex)
        self._earlier: list[list[FoundEigenvalue]] = [[] for _ in self.M]

    def ascend(self, count: int, agree: int) -> None:
        """Keep the best of ``count`` ascents; the search ends earlier once ``agree`` of them
        agree.

        One full block needs no search: its Delta is that of the largest singular value.
        """
        if self.structure.unstructured:
            u, size, vh = np.linalg.svd(self.M, full_matrices=False)
            first = vh[:, 0].conj()[:, :, None] * u[:, :, 0].conj()[:, None, :]
            self.improve(slice(0, len(self.M)), size[:, 0], first)
            return
        starts = self.varied_starts(count)
        places = range(0, len(self.M), DEADLINE_MATRICES)
        chunks = [slice(place, place + DEADLINE_MATRICES) for place in places]
        for chunk in self._context.track(chunks, "ascent"):
            self.improve(chunk, *search_batch(self.M[chunk], self.table, *starts, agree))

    def starts(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Random vectors and real blocks from which power iterations start."""
        rng = self._context.rng
        reals = rng.uniform(-1.0, 1.0, (count, len(self.structure)))
        return unit_starts(count, self.structure.rows, rng), reals

    def varied_starts(self, count: int) -> tuple[np.ndarray, ...]:
        """Starts of `search_batch` of three kinds in turn: real blocks move, are held, or are held
        at a level.
        """
        vectors, reals = self.starts(count)
        real = np.array([isinstance(block, Real) for block in self.structure])
        moving, levels = np.ones(count, bool), np.zeros(count)
        if real.any() and not real.all():
            half = sign_patterns(int(real.sum()), self._context.rng)
            vertices = np.stack([half, -half], axis=1).reshape(-1, half.shape[1])
            kinds = np.resize(list(RUN_KINDS), count)
            for kind in "HL":
                places = np.flatnonzero(kinds == kind)
                reals[np.ix_(places, real)] = np.resize(vertices, (len(places), half.shape[1]))
            moving = kinds == "M"
            levels[kinds == "L"] = self._context.rng.uniform(*RUN_LEVELS, np.sum(kinds == "L"))
        return vectors, reals, moving, levels

    def improve(self, chunk: slice, values: np.ndarray, deltas: np.ndarray) -> None:
        """Keep the values and Deltas of a chunk that are better than the known ones."""
        for index in np.flatnonzero(values > self.value[chunk]):
            self._keep(chunk.start + index, values[index], deltas[index])

    def each(self, description: str, find: Callable[[int], FoundEigenvalue]) -> None:
        """Keep the result of `find` for each matrix whose known proposal it improves."""
        for index in self._context.track(range(len(self.M)), description):
            value, delta = find(index)
            if value > self.value[index]:
                self._keep(index, value, delta)

    def _keep(self, index: int, value: float, delta: np.ndarray) -> None:
        """Keep a better proposal for a matrix, and also the last few earlier ones."""
        if self.value[index] > 0:
            before = *self._earlier[index], (self.value[index], self.delta[index].copy())
            self._earlier[index] = list(before[-RUNNERS_UP:])
        self.value[index], self.delta[index] = value, delta

    def from_vertices(self, index: int) -> FoundEigenvalue:
        """The best Delta of one matrix found from vertices and edges of the real blocks."""
        M, rng = self.M[index], self._context.rng
        if not M.any():
            return 0.0, self.delta[index]
        if all(isinstance(block, Real) for block in self.structure):
            return real_bound(M, self.structure, rng)
        level = self.value[index] or 0.5 * float(np.linalg.norm(M, 2))
        found = [gain_bound(M, self.structure, level, rng), held_bound(M, self.structure, rng)]
        least = max(float(self.value[index]), *(value for value, _ in found))
        found.append(weak_bound(M, self.structure, least, rng))
        return max(found, key=lambda one: one[0])

    def from_exact_vertices(self) -> Callable[[int], FoundEigenvalue]:
        """Function that gives the best Delta of one matrix with all real blocks at their ends.

        For structures of real blocks only. There a real M has exactly real eigenvalues; a complex M
        may have some.
        """
        sizes = [block.rows for block in self.structure]
        few, many = (
            np.repeat(sign_patterns(len(sizes), self._context.rng, limit), sizes, axis=1)
            for limit in (MOST_COMPLEX_VERTICES, MOST_VERTICES)
        )

        def find(index: int) -> FoundEigenvalue:
            M = self.M[index]
            value, diagonal = best_vertex(M, few if M.imag.any() else many)
            return value, np.diag(diagonal).astype(complex)

        return find

    def from_nonlinear(self, context: Context) -> Callable[[int], FoundEigenvalue]:
        """Function that gives the best Delta of one matrix found by the nonlinear program."""
        nonlinear = NonlinearSearch(self.structure, context)

        def find(index: int) -> FoundEigenvalue:
            starts = [self.structure.random(context.rng) for _ in range(NONLINEAR_STARTS)]
            return nonlinear.best_of(self.M[index], [start.astype(complex) for start in starts])

        return find

    def proposed(self) -> LowerBound:
        """The best proposals (B,), in the units of the given matrices."""
        return unscaled(self.value, self.delta, self._exponent)

    def _proven(self, M: np.ndarray, Delta: np.ndarray) -> np.ndarray:
        """Bounds (B,) that Deltas prove, each at most 1 over the size of its Delta; 0: no proof."""
        proven = proven_bounds(M, self.structure, Delta)
        size = np.linalg.norm(np.where(proven[:, None, None] > 0, Delta, 1.0), 2, axis=(1, 2))
        return np.minimum(said(proven), 1 / size)

    def claim(self) -> Claim:
        """The proven bounds, in the units of the given matrices."""
        proposed = self.proposed()
        found = proposed.value > 0
        M = self._program.M.reshape(-1, *self._program.M.shape[-2:])
        proven = self._proven(M, proposed.Delta)
        Delta = proposed.Delta
        for index in np.flatnonzero(found & (proven == 0)):
            one = slice(index, index + 1)
            for value, delta in reversed(self._earlier[index]):
                other = unscaled(np.array([value]), delta[None], self._exponent[one]).Delta
                proven[one], Delta[one] = self._proven(M[one], other), other
                if proven[index] > 0:
                    break
        Delta[proven == 0] = np.nan
        missed, unproven = np.count_nonzero(~found), np.count_nonzero(found & (proven == 0))
        said = [
            f"nothing destabilising found for {missed} of {len(M)}" if missed else "",
            f"not proven for {unproven} of {len(M)}" if unproven else "",
        ]
        batch = self._program.batch
        bound = LowerBound(proven.reshape(batch), Delta.reshape(*batch, *Delta.shape[1:]))
        return bound, Outcome.SOLVED, "; ".join(filter(None, said))
