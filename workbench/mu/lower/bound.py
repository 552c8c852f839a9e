"""Lower bounds of mixed mu, with the perturbations that prove them."""

from __future__ import annotations

from typing import Any

from workbench.answer import answer_of
from workbench.mu.lower.program import LowerBound, MuLowerBound
from workbench.solvers import Options
from workbench.structure import Structure

__all__ = ["LowerBound", "MuLowerBound", "lower_bound"]


def lower_bound(
    M: Any, structure: Structure, *, method: str = "best", options: Options | None = None
) -> LowerBound:
    """Proven lower bound of mixed mu, and a Delta of that size that makes I - M Delta singular.

    Parameters
    ----------
    M
        Complex or real (..., columns, rows), finite. M maps the outputs of Delta to its inputs.
    structure
        The blocks of Delta.
    method
        ``"best"``; ``"power"`` (fast, for sweeps), ``"gain"`` (real blocks), ``"ipopt"``.

    Returns
    -------
    LowerBound
        ``value`` (...) and ``Delta`` (..., rows, columns), no larger than 1 / value. Where nothing
        was proven, the value is 0 and Delta is NaN. The `certificate` is made when it is first
        asked for. `MuLowerBound` says how little a lower bound means where all blocks are real.

    Raises
    ------
    InputError
        M does not fit the structure or has an entry that is not finite.
    SolverError
        The method gave no answer.
    """
    bound: LowerBound = answer_of(MuLowerBound(M, structure), method, options)
    return bound
