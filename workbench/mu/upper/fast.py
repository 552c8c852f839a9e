"""The bench's own method: a compiled interior-point method for a whole batch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench.executor import Context
from workbench.mu.upper.multipliers import path_multipliers
from workbench.mu.upper.pattern import expanded_multipliers, pattern_of
from workbench.mu.upper.program import MuUpperBound, UpperBound, proved
from workbench.mu.upper.recentred import recentred
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.structure import Structure

THREAD_MATRICES = 200
"""Number of matrices that one thread takes at a time. Their paths take far longer than handing them
over. Half or double changes the time only.
"""
PATH_ACCURACY_SHARE = 0.02
"""The central path is followed to this share of the accuracy asked for. The share holds for t =
beta^2, so the bound beta is twice as accurate. The rest of the accuracy is for rounding outward and
for lost paths. With half of it a path takes one iteration more; with double of it, one less.
"""
SPOILT_BOUND_RATIO = 1 + 1e-6
"""A bound above this multiple of the largest singular value is spoilt by rounding. A bound that
holds is no larger, except by rounding outward, 1e-9. Half or double decides the same.
"""

POWER_STEPS = 3
"""Steps of the power iteration for the largest singular value. It only has to tell bounds that are
spoilt by a factor. With half of them, more bounds are taken for spoilt and computed again; double
costs time.
"""

pattern_of_structure = lru_cache(maxsize=32)(pattern_of)
"""`pattern_of`, kept for structures used before."""


@dataclass(frozen=True)
class BatchBounds:
    """Bounds (F,) of a batch, gaps (F,) of their squares, and iterations (F,) made for them."""

    answer: UpperBound
    gaps: RealArray
    iterations: Array


@method(MuUpperBound, "fast", optimal=False)
def _fast(program: MuUpperBound, context: Context) -> Claim:
    """Osborne's balancing and a compiled primal-dual interior-point method, all M at once.

    If no scalar is repeated, each instruction works on eight matrices at once; a single repeated
    scalar has a closed form.
    """
    structure = program.structure
    with context.stating():
        pattern_of_structure(structure)
    batch = np.ascontiguousarray(program.M.reshape(-1, structure.columns, structure.rows))
    found = batch_bounds(batch, structure, context)
    gaps, count = found.gaps, len(batch)
    early = int(np.sum(gaps > context.options.accuracy))
    message = f"at most {found.iterations.max(initial=0)} iterations"
    if early:
        gap = gaps.max()
        share = f"up to {gap:.2g} (relative, of its square)" if gap < 1 else "by an unknown share"
        message += (
            f"; stopped early for {early} of {count} matrices, the bound valid but {share} above "
            "the least"
        )
    answer = found.answer.reshaped(program.batch)
    return answer, Outcome.INACCURATE if early else Outcome.SOLVED, message


def batch_bounds(
    batch: ComplexArray, structure: Structure, context: Context, level: float = 0.0
) -> BatchBounds:
    """Bounds of matrices (F, c, r); a bound up to the level is low enough, and level 0 asks for the
    least bound.
    """
    pattern = pattern_of_structure(structure)
    count = len(batch)
    D, G = np.zeros((2, count, pattern.size, pattern.size), complex)
    gaps, iterations = np.zeros(count), np.zeros(count, int)
    accuracy = PATH_ACCURACY_SHARE * context.options.accuracy
    chunks = [slice(start, start + THREAD_MATRICES) for start in range(0, count, THREAD_MATRICES)]
    solve = partial(path_multipliers, structure, pattern, accuracy, level)
    found = context.spread(solve, [batch[chunk] for chunk in chunks], "upper bounds")
    for chunk, one in zip(chunks, found, strict=True):
        D[chunk], G[chunk], gaps[chunk], iterations[chunk] = one
    answer = proved(batch, structure, *expanded_multipliers(pattern, D, G))
    low = answer.value <= level
    missed = np.flatnonzero((level > 0) & (gaps == 0) & ~low)
    if missed.size:  # rounding lifted the bound over the level
        D[missed], G[missed], gaps[missed], iterations[missed] = path_multipliers(
            structure, pattern, accuracy, 0.0, batch[missed]
        )
    spoilt = ~low
    spoilt[spoilt] = _above_norm(answer.value[spoilt], batch[spoilt])
    again = np.flatnonzero(~np.isfinite(answer.value) | spoilt | (gaps > context.options.accuracy))
    for i in again:
        end = D[i].copy(), G[i].copy()
        D[i], G[i], gaps[i] = recentred(batch[i], structure, pattern, end, gaps[i], accuracy)
    again = np.union1d(again, missed)
    if again.size:
        multipliers = expanded_multipliers(pattern, D[again], G[again])
        better = proved(batch[again], structure, *multipliers)
        for name in ("value", "D_left", "D_right", "G"):
            getattr(answer, name)[again] = getattr(better, name)
    return BatchBounds(answer, gaps, iterations)


def _above_norm(value: RealArray, M: ComplexArray) -> np.ndarray:
    """Which bounds (F,) exceed the largest singular value of M (F, c, r), so that rounding has
    spoilt them.
    """
    moduli = np.abs(M)
    size = moduli.max(axis=(1, 2), initial=np.finfo(float).tiny)
    value, moduli = value / size, moduli / size[:, None, None]
    # quick lower bounds of that singular value: norms of rows, then power iteration from the
    # largest row
    spoilt = value > np.sqrt((moduli**2).sum(axis=2).max(axis=1, initial=0.0))
    value, moduli, M = value[spoilt], moduli[spoilt], M[spoilt] / size[spoilt, None, None]
    vector = np.take_along_axis(M, moduli.sum(axis=2).argmax(axis=1)[:, None, None], axis=1)
    vector = vector.conj().mT
    for _ in range(POWER_STEPS):
        image = M @ vector
        vector = M.conj().mT @ image
        vector /= np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), np.finfo(float).tiny)
    left = value > np.linalg.norm(M @ vector, axis=(1, 2))
    left[left] = value[left] > SPOILT_BOUND_RATIO * np.linalg.norm(M[left], 2, axis=(1, 2))
    spoilt[spoilt] = left
    return spoilt
