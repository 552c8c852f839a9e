"""The bench's own method: a compiled interior-point method for a whole batch."""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np

from workbench.arrays import Array, ComplexArray
from workbench.certify.mu_bound import certified_bound
from workbench.executor import Context
from workbench.mu.upper.batch import solve_each
from workbench.mu.upper.pattern import Pattern, expanded_multipliers, pattern_of
from workbench.mu.upper.program import MuUpperBound, proved
from workbench.mu.upper.recentred import recentred
from workbench.program import Claim, method
from workbench.solvers import Outcome

THREAD_MATRICES = 200
"""Matrices that one thread takes at a time; each is warm-started from the one before."""
PATH_ACCURACY_SHARE = 0.02
"""The central path is followed to this share of the accuracy asked for. The share holds for
t = beta^2, so the bound beta is twice as accurate."""
SPOILT_BOUND_RATIO = 1 + 1e-6
"""A bound above this multiple of the largest singular value is spoilt by rounding."""

_pattern = lru_cache(maxsize=32)(pattern_of)


def _solved(pattern: Pattern, accuracy: float, M: ComplexArray) -> tuple[Array, ...]:
    """Multipliers D and G, gaps and numbers of iterations of matrices M (B, c, r).

    Each matrix is warm-started from the one before.
    """
    count = len(M)
    D, G = np.zeros((2, count, pattern.size, pattern.size), complex)
    gaps, iterations = np.zeros(count), np.zeros(count, int)
    solve_each(M, pattern, accuracy, D, G, gaps, iterations)
    return D, G, gaps, iterations


@method(MuUpperBound, "fast", optimal=False)
def _fast(program: MuUpperBound, context: Context) -> Claim:
    """Osborne's balancing and a compiled primal-dual interior-point method, all M at once."""
    structure = program.structure
    with context.stating():
        pattern = _pattern(structure)
    batch = np.ascontiguousarray(program.M.reshape(-1, structure.columns, structure.rows))
    count = len(batch)
    D, G = np.zeros((2, count, pattern.size, pattern.size), complex)
    gaps, iterations = np.zeros(count), np.zeros(count, int)
    accuracy = PATH_ACCURACY_SHARE * context.options.accuracy
    parts = [slice(start, start + THREAD_MATRICES) for start in range(0, count, THREAD_MATRICES)]

    solve = partial(_solved, pattern, accuracy)
    found = context.spread(solve, [batch[part] for part in parts], "upper bounds")
    for part, one in zip(parts, found, strict=True):
        D[part], G[part], gaps[part], iterations[part] = one
    values = certified_bound(batch, structure, *expanded_multipliers(pattern, D, G))
    lost = ~np.isfinite(values) | (
        values > SPOILT_BOUND_RATIO * np.linalg.norm(batch, 2, axis=(1, 2))
    )
    for i in np.flatnonzero(lost | (gaps > context.options.accuracy)):
        end = D[i].copy(), G[i].copy()
        D[i], G[i], gaps[i] = recentred(batch[i], structure, pattern, end, gaps[i], accuracy)
    answer = proved(
        program,
        *(
            part.reshape(*program.batch, *part.shape[1:])
            for part in expanded_multipliers(pattern, D, G)
        ),
    )
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
