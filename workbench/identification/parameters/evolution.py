"""Parameter fits by differential evolution, which needs neither derivatives nor a good start."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.identification.parameters.program import ParameterFit
from workbench.program import Claim, method
from workbench.solvers import Outcome

MEMBERS, MOST_GENERATIONS = 15, 2000
"""Members of a population for each parameter, and largest number of generations."""
SETTLED = 1e-10
"""A population has settled if its sums of squares agree to this relative accuracy."""
EXACT_FIT = 1e-25
"""The same tolerance relative to the sum of the data's squares, for data that fit exactly."""


def _unbounded(program: ParameterFit) -> str | None:
    """The reason why no population can be drawn; None if all bounds are finite."""
    finite = np.isfinite(program.lower) & np.isfinite(program.upper)
    if finite.all():
        return None
    missing = ", ".join(name for name, is_finite in zip(program.names, finite, strict=True)
                        if not is_finite)  # fmt: skip
    return f"it searches between finite bounds, which {missing} lacks; give them or use ipopt"


@method(ParameterFit, "evolution", optimal=False, unfit=_unbounded, accuracy=ANY_ACCURACY_ALIKE)
def _evolution(program: ParameterFit, context: Context) -> Claim:
    """Differential evolution between the bounds: no derivatives, no good start needed.

    Parameters whose bounds are positive are drawn on a logarithmic scale. R. Storn, K. Price,
    Differential evolution, J. Global Optimization 11 (1997) 341-359.
    """
    from scipy.optimize import differential_evolution

    positive = program.lower > 0
    low, high = (np.where(positive, np.log(np.where(positive, bound, 1.0)), bound)
                 for bound in (program.lower, program.upper))  # fmt: skip

    def values(drawn: np.ndarray) -> np.ndarray:
        found = np.where(positive, np.exp(np.where(positive, drawn, 0.0)), drawn)
        return np.asarray(np.clip(found, program.lower, program.upper))

    def cost(drawn: np.ndarray) -> float:
        size = float(np.sum(program.residuals(values(drawn)) ** 2))
        return size if np.isfinite(size) else float(np.finfo(float).max)

    generations = iter(context.rounds(MOST_GENERATIONS, "generations"))

    def ended(intermediate_result: Any) -> bool:
        """Whether the time limit, or the last generation, ends the search."""
        best = float(intermediate_result.fun)
        context.record({"generation": len(context.rows) + 1, "sum of squares": best})
        return next(generations, None) is None

    found = differential_evolution(
        cost,
        list(zip(low, high, strict=True)),
        popsize=MEMBERS,
        maxiter=MOST_GENERATIONS,
        tol=SETTLED,
        atol=EXACT_FIT * program.size**2,
        rng=context.rng,
        polish=False,
        callback=ended,
    )
    outcome = Outcome.SOLVED if found.success else Outcome.INACCURATE
    return values(found.x), outcome, f"evolution: {found.message}"
