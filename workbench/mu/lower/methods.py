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

RUNS = 2
"""Random starts of the power iteration, besides the warm one."""
SEARCHES = 6
"""The same, where each is followed by an ascent."""
AGREEMENT = 3
"""Ascents that must meet at the best value before a search ends early."""
NONLINEAR_STARTS = 6
CHUNK = 250
"""Matrices between two looks at the clock."""

Found = tuple[float, np.ndarray]


def _has_real(program: MuLowerBound) -> str | None:
    if any(isinstance(block, Real) for block in program.structure):
        return None
    return "the structure has no real block; use 'power' or 'best'"


@method(MuLowerBound, "power", optimal=False)
def _power(program: MuLowerBound, context: Context) -> Claim:
    """Power iteration of Packard, Fan, Doyle and Young from random and warm starts."""
    search = _Search(program, context)
    for chunk in search.chunks("power iteration"):
        values, deltas = power_batch(search.M[chunk], search.table, *search.starts(RUNS), False)
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
    """Nonlinear program in Delta and the singular vector, from random starts."""
    search = _Search(program, context)
    search.each("nonlinear program", search.from_nonlinear(context))
    return search.claim()


@method(MuLowerBound, "best", optimal=False)
def _best(program: MuLowerBound, context: Context) -> Claim:
    """The best of power iterations with local ascents and, for real blocks, their vertices."""
    search = _Search(program, context)
    for chunk in search.chunks("ascent"):
        search.improve(
            chunk, *search_batch(search.M[chunk], search.table, *search.starts(SEARCHES), AGREEMENT)
        )
    if any(isinstance(block, Real) for block in program.structure):
        search.each("real blocks", search.from_vertices)
    return search.claim()


class _Search:
    """The matrices of a program in fit units, and the best found for each."""

    def __init__(self, program: MuLowerBound, context: Context) -> None:
        self._program, self._context = program, context
        self.structure = program.structure
        self.table = block_table(program.structure)
        shape = program.M.shape[-2:]
        self.M, self._exponent = scaled(program.M.reshape(-1, *shape), program.structure)
        self.value = np.zeros(len(self.M))
        self.delta = np.zeros((len(self.M), *shape[::-1]), complex)

    def chunks(self, description: str) -> list[slice]:
        starts = range(0, len(self.M), CHUNK)
        return list(self._context.track([slice(at, at + CHUNK) for at in starts], description))

    def starts(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Vectors and real blocks that power iterations start from."""
        rng = self._context.rng
        reals = rng.uniform(-1.0, 1.0, (count, len(self.structure)))
        return unit_starts(count, self.structure.rows, rng), reals

    def improve(self, chunk: slice, values: np.ndarray, deltas: np.ndarray) -> None:
        better = values > self.value[chunk]
        self.value[chunk][better] = values[better]
        self.delta[chunk][better] = deltas[better]

    def each(self, description: str, find: Callable[[int], Found]) -> None:
        for index in self._context.track(range(len(self.M)), description):
            value, delta = find(index)
            if value > self.value[index]:
                self.value[index], self.delta[index] = value, delta

    def from_vertices(self, index: int) -> Found:
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
        nonlinear = NonlinearSearch(self.structure, context)

        def find(index: int) -> Found:
            starts = [self.structure.random(context.rng) for _ in range(NONLINEAR_STARTS)]
            return nonlinear.best_of(self.M[index], [start.astype(complex) for start in starts])

        return find

    def claim(self) -> Claim:
        bound = unscaled(self.value, self.delta, self._exponent, self._program.batch)
        missed = int(np.count_nonzero(bound.value == 0))
        message = (
            f"nothing destabilising found for {missed} of {bound.value.size}" if missed else ""
        )
        return bound, Outcome.SOLVED, message
