"""The methods of the mixed-mu lower bound."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench.executor import Context
from workbench.mu.lower.ascent import search_batch
from workbench.mu.lower.attain import block_table
from workbench.mu.lower.mixed_blocks import gain_bound, held_bound, weak_bound
from workbench.mu.lower.nonlinear import NonlinearSearch
from workbench.mu.lower.power import power_batch
from workbench.mu.lower.program import MuLowerBound
from workbench.mu.lower.real_blocks import real_bound, unit_starts
from workbench.mu.lower.scaling import scaled, unscaled
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.structure import Real

POWER_STARTS = 2
"""Random starts of the power iteration, in addition to the warm start."""
ASCENT_STARTS = 6
"""Random starts where an ascent follows each power iteration."""
AGREEING_ASCENTS = 3
"""Ascents that must reach the best value before a search ends early."""
NONLINEAR_STARTS = 6
"""Random starts of the nonlinear program."""
CHUNK_MATRICES = 250
"""Matrices computed between two checks of the deadline."""

Found = tuple[float, np.ndarray]
"""A real eigenvalue of M Delta (0: none found) and its Delta."""


def _has_real(program: MuLowerBound) -> str | None:
    """Why a method for real blocks cannot take the program; None where it can."""
    if any(isinstance(block, Real) for block in program.structure):
        return None
    return "the structure has no real block; use 'power' or 'best'"


@method(MuLowerBound, "power", optimal=False)
def _power(program: MuLowerBound, context: Context) -> Claim:
    """Power iteration of Packard, Fan, Doyle and Young from random and warm starts."""
    search = _Search(program, context)
    for chunk in search.chunks("power iteration"):
        values, deltas = power_batch(
            search.M[chunk], search.table, *search.starts(POWER_STARTS), False
        )
        best = np.argmax(values, axis=0)
        search.improve(chunk, values.max(axis=0), deltas[best, np.arange(values.shape[1])])
    return search.claim()


@method(MuLowerBound, "gain", optimal=False, unfit=_has_real)
def _gain(program: MuLowerBound, context: Context) -> Claim:
    """Vertices and edges of the real blocks, complex ones by the gain of the loop they close."""
    search = _Search(program, context)
    search.each("gain", search.from_vertices)
    return search.claim()


@method(MuLowerBound, "ipopt", optimal=False)
def _ipopt(program: MuLowerBound, context: Context) -> Claim:
    """A nonlinear program in Delta and the singular vector, solved from random starts."""
    search = _Search(program, context)
    search.each("nonlinear program", search.from_nonlinear(context))
    return search.claim()


@method(MuLowerBound, "best", optimal=False)
def _best(program: MuLowerBound, context: Context) -> Claim:
    """The best of power iterations with local ascents and, for real blocks, their vertices."""
    search = _Search(program, context)
    for chunk in search.chunks("ascent"):
        search.improve(
            chunk,
            *search_batch(
                search.M[chunk], search.table, *search.starts(ASCENT_STARTS), AGREEING_ASCENTS
            ),
        )
    if any(isinstance(block, Real) for block in program.structure):
        search.each("real blocks", search.from_vertices)
    return search.claim()


class _Search:
    """The balanced matrices of a program, and the best bound found so far for each."""

    def __init__(self, program: MuLowerBound, context: Context) -> None:
        self._program, self._context = program, context
        self.structure = program.structure
        self.table = block_table(program.structure)
        shape = program.M.shape[-2:]
        self.M, self._exponent = scaled(program.M.reshape(-1, *shape), program.structure)
        self.value = np.zeros(len(self.M))
        self.delta = np.zeros((len(self.M), *shape[::-1]), complex)

    def chunks(self, description: str) -> list[slice]:
        """Slices of the batch, with progress shown under a description."""
        starts = range(0, len(self.M), CHUNK_MATRICES)
        return list(
            self._context.track([slice(at, at + CHUNK_MATRICES) for at in starts], description)
        )

    def starts(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Random vectors and real blocks from which power iterations start."""
        rng = self._context.rng
        reals = rng.uniform(-1.0, 1.0, (count, len(self.structure)))
        return unit_starts(count, self.structure.rows, rng), reals

    def improve(self, chunk: slice, values: np.ndarray, deltas: np.ndarray) -> None:
        """Keep values and Deltas of a chunk where they are better than those known."""
        better = values > self.value[chunk]
        self.value[chunk][better] = values[better]
        self.delta[chunk][better] = deltas[better]

    def each(self, description: str, find: Callable[[int], Found]) -> None:
        """Keep what `find` gives for each matrix where it is better than what is known."""
        for index in self._context.track(range(len(self.M)), description):
            value, delta = find(index)
            if value > self.value[index]:
                self.value[index], self.delta[index] = value, delta

    def from_vertices(self, index: int) -> Found:
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

    def from_nonlinear(self, context: Context) -> Callable[[int], Found]:
        """A function that gives the best Delta of one matrix found by the nonlinear program."""
        nonlinear = NonlinearSearch(self.structure, context)

        def find(index: int) -> Found:
            starts = [self.structure.random(context.rng) for _ in range(NONLINEAR_STARTS)]
            return nonlinear.best_of(self.M[index], [start.astype(complex) for start in starts])

        return find

    def claim(self) -> Claim:
        """The bounds found, in the units of the given matrices."""
        bound = unscaled(self.value, self.delta, self._exponent, self._program.batch)
        missed = int(np.count_nonzero(bound.value == 0))
        message = (
            f"nothing destabilising found for {missed} of {bound.value.size}" if missed else ""
        )
        return bound, Outcome.SOLVED, message
