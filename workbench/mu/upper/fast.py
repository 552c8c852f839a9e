"""The bench's own method: a compiled interior-point method for a whole batch."""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np

from workbench.arrays import Array, ComplexArray, RealArray
from workbench.certify.mu_bound import certified_bound
from workbench.executor import Context
from workbench.mu.upper.alone import closed_form, is_alone
from workbench.mu.upper.batch import balanced_batch, solve_each
from workbench.mu.upper.lanes.path import follow_paths
from workbench.mu.upper.pattern import (
    Pattern,
    diagonal_places,
    expanded_multipliers,
    pattern_of,
)
from workbench.mu.upper.program import MuUpperBound, proved
from workbench.mu.upper.recentred import recentred
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.structure import Structure

THREAD_MATRICES = 200
"""Matrices that one thread takes at a time."""
PATH_ACCURACY_SHARE = 0.02
"""The central path is followed to this share of the accuracy asked for. The share holds for
t = beta^2, so the bound beta is twice as accurate."""
SPOILT_BOUND_RATIO = 1 + 1e-6
"""A bound above this multiple of the largest singular value is spoilt by rounding."""

POWER_STEPS = 3
"""Steps of the power iteration for the largest singular value."""

_pattern = lru_cache(maxsize=32)(pattern_of)


def _solved(
    structure: Structure, pattern: Pattern, accuracy: float, M: ComplexArray
) -> tuple[Array, ...]:
    """Multipliers D and G, gaps and numbers of iterations of matrices M (B, c, r)."""
    count = len(M)
    D, G = np.zeros((2, count, pattern.size, pattern.size), complex)
    gaps, iterations = np.full(count, np.inf), np.zeros(count, int)
    places = diagonal_places(pattern)
    if places is not None:
        scaled, E, scale = np.empty_like(M), np.empty((count, pattern.size)), np.empty(count)
        balanced_batch(M, pattern, scaled, E, scale)
        d, g = np.empty((count, pattern.size)), np.empty((count, places.row.size))
        follow_paths(scaled, places, accuracy, d, g, gaps, iterations)
        nothing = scale == 0  # no size that balancing leaves: D is the balancing itself
        d[nothing], g[nothing] = 1.0, 0.0
        every, real = np.arange(pattern.size), pattern.row[pattern.skew]
        with np.errstate(all="ignore"):  # what is not finite proves nothing
            D[:, every, every] = d * E * E
            G[:, real, real] = g * E[:, real] * E[:, real] * scale[:, None]
        gaps[nothing] = 0.0
    elif is_alone(structure):
        first_D, first_G, mu = closed_form(M, structure)
        exact = certified_bound(M, structure, first_D, first_D, first_G) <= (1 + accuracy) * mu
        D[exact], G[exact], gaps[exact] = first_D[exact], first_G[exact], 0.0
    rest = np.flatnonzero(~(gaps <= accuracy))
    if rest.size:  # each is warm-started from the one before
        found = D[rest], G[rest], gaps[rest], iterations[rest]
        solve_each(M[rest], pattern, accuracy, *found)
        D[rest], G[rest], gaps[rest], iterations[rest] = found
    return D, G, gaps, iterations


@method(MuUpperBound, "fast", optimal=False)
def _fast(program: MuUpperBound, context: Context) -> Claim:
    """Osborne's balancing and a compiled primal-dual interior-point method, all M at once.

    Where no scalar is repeated eight matrices are worked on by each instruction; one repeated
    scalar alone has a closed form.
    """
    structure = program.structure
    with context.stating():
        pattern = _pattern(structure)
    batch = np.ascontiguousarray(program.M.reshape(-1, structure.columns, structure.rows))
    count = len(batch)
    D, G = np.zeros((2, count, pattern.size, pattern.size), complex)
    gaps, iterations = np.zeros(count), np.zeros(count, int)
    accuracy = PATH_ACCURACY_SHARE * context.options.accuracy
    chunks = [slice(start, start + THREAD_MATRICES) for start in range(0, count, THREAD_MATRICES)]

    solve = partial(_solved, structure, pattern, accuracy)
    found = context.spread(solve, [batch[chunk] for chunk in chunks], "upper bounds")
    for chunk, one in zip(chunks, found, strict=True):
        D[chunk], G[chunk], gaps[chunk], iterations[chunk] = one
    answer = proved(batch, structure, *expanded_multipliers(pattern, D, G))
    again = np.flatnonzero(
        ~np.isfinite(answer.value)
        | _above_norm(answer.value, batch)
        | (gaps > context.options.accuracy)
    )
    for i in again:
        end = D[i].copy(), G[i].copy()
        D[i], G[i], gaps[i] = recentred(batch[i], structure, pattern, end, gaps[i], accuracy)
    if again.size:
        multipliers = expanded_multipliers(pattern, D[again], G[again])
        better = proved(batch[again], structure, *multipliers)
        for name in ("value", "D_left", "D_right", "G"):
            getattr(answer, name)[again] = getattr(better, name)
    answer = answer.reshaped(program.batch)
    early = int(np.sum(gaps > context.options.accuracy))
    message = f"at most {iterations.max(initial=0)} iterations"
    if early:
        gap = gaps.max()
        share = f"up to {gap:.2g} (relative, of its square)" if gap < 1 else "by an unknown share"
        message += (
            f"; stopped early for {early} of {count} matrices, the bound valid but {share} above "
            "the least"
        )
    return answer, Outcome.INACCURATE if early else Outcome.SOLVED, message


def _above_norm(value: RealArray, M: ComplexArray) -> np.ndarray:
    """Where bounds (F,) are above the largest singular value of M (F, c, r): spoilt by rounding."""
    size = np.abs(M).max(axis=(1, 2), initial=np.finfo(float).tiny)
    value, M = value / size, M / size[:, None, None]
    # a quick bound of that from below, by power iteration from the largest row
    vector = np.take_along_axis(M, np.abs(M).sum(axis=2).argmax(axis=1)[:, None, None], axis=1)
    vector = vector.conj().mT
    for _ in range(POWER_STEPS):
        image = M @ vector
        vector = M.conj().mT @ image
        vector /= np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), np.finfo(float).tiny)
    spoilt = value > np.linalg.norm(M @ vector, axis=(1, 2))
    spoilt[spoilt] = value[spoilt] > SPOILT_BOUND_RATIO * np.linalg.norm(M[spoilt], 2, axis=(1, 2))
    return spoilt
