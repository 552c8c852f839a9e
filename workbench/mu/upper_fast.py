"""The bench's own method: one compiled interior-point method for a whole batch."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from workbench.executor import Context
from workbench.mu.upper_batch import solve_each
from workbench.mu.upper_pattern import pattern_of, spread
from workbench.mu.upper_program import MuUpperBound, proved
from workbench.program import Claim, method
from workbench.solvers import Outcome

CHUNK = 1000
"""Matrices between two looks at the clock."""
SHARE = 0.02
"""Share of the accuracy asked for at which the path is left; the bound takes half of that."""

_pattern = lru_cache(maxsize=32)(pattern_of)


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
    accuracy = SHARE * context.options.accuracy
    for start in context.track(range(0, count, CHUNK), "upper bounds"):
        part = slice(start, start + CHUNK)
        solve_each(batch[part], pattern, accuracy, D[part], G[part], gaps[part], iterations[part])
    answer = proved(
        program, *(part.reshape(*program.batch, *part.shape[1:]) for part in spread(pattern, D, G))
    )
    early = int(np.sum(gaps > context.options.accuracy))
    message = f"at most {iterations.max(initial=0)} iterations"
    if early:
        message += (
            f"; stopped early for {early} of {count} matrices, the bound valid but up to "
            f"{gaps.max():.2g} (relative, of its square) above the least"
        )
    return answer, Outcome.INACCURATE if early else Outcome.SOLVED, message
