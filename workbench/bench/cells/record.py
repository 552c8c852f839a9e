"""The record of how a cell ended, for the table of a comparison."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from workbench.bench.results import Run
from workbench.certificate import Certificate
from workbench.errors import CrashedError, MemoryLimitError, ResultError, TimeLimitError
from workbench.program import Program
from workbench.solution import Solution
from workbench.solvers import Outcome

CELL = "cell"
"""Name of the part of run.json that only cells have."""


@dataclass(frozen=True)
class Record:
    """How a cell ended.

    ``objective`` is that of a valid answer, to be minimised; ``scale`` makes differences of it
    relative; ``rounding`` is the difference that rounding can cause; ``gap`` is the certified
    relative distance from the optimum (`certified_gap`). Wall times of statement, solve and check,
    and CPU time of the first two [s]; largest resident memory of the process during them [byte].
    NaN stands for a missing number.
    """

    outcome: str
    claim: str = ""
    message: str = ""
    certified: bool = False
    objective: float = math.nan
    scale: float = math.nan
    rounding: float = math.nan
    gap: float = math.nan
    statement: float = math.nan
    solve: float = math.nan
    check: float = math.nan
    cpu: float = math.nan
    memory: float = math.nan

    @classmethod
    def of(cls, task: Program, solution: Solution, cpu: float, memory: float) -> Record:
        """The record of an answer that has been checked."""
        certificate = solution.certificate
        own = certificate is not None and solution.proof is None
        objective, scale, rounding = math.nan, math.nan, math.nan
        if own and certificate is not None and certificate.valid:
            value = task.objective(solution.answer)
            if value is not None:
                objective = float(value)
                scale = float(task.objective_scale(solution.answer))
                rounding = float(task.objective_rounding(solution.answer))
        statement, solve, check = (
            solution.seconds.get(name, math.nan) for name in ("statement", "solve", "check")
        )
        return cls(
            solution.outcome,
            solution.claim,
            _reason(solution),
            solution.outcome.proven,
            objective,
            scale,
            rounding,
            certified_gap(certificate) if own else math.nan,
            statement,
            solve,
            check,
            cpu,
            memory,
        )

    @classmethod
    def lost(cls, error: BaseException) -> Record:
        """The record of a cell whose worker or task did not finish.

        The outcome is entered as the claim too, as in the folder that `store_lost` writes.
        """
        if isinstance(error, TimeLimitError):
            return cls(Outcome.TIME_LIMIT, Outcome.TIME_LIMIT, str(error))
        if isinstance(error, MemoryLimitError):
            return cls(Outcome.MEMORY_LIMIT, Outcome.MEMORY_LIMIT, str(error))
        if isinstance(error, CrashedError):
            return cls(Outcome.CRASHED, Outcome.CRASHED, str(error))
        return cls(Outcome.FAILED, Outcome.FAILED, f"{type(error).__name__}: {error}")

    @classmethod
    def stored(cls, run: Run) -> Record:
        """The record in a cell's results folder."""
        return cls.from_json(
            {**run.info.get(CELL, {}), **_outcome_and_claim(run.info)}, str(run.path)
        )

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, stored: Mapping[str, Any], place: str) -> Record:
        """A record read back from JSON.

        Numbers that JSON lacks, such as NaN, are stored by name.
        """
        try:
            values: dict[str, Any] = {
                one.name: float(stored[one.name]) if one.type == "float" else stored[one.name]
                for one in fields(cls)
            }
        except (KeyError, TypeError, ValueError) as error:
            raise ResultError(f"{place} holds no cell: {type(error).__name__} {error}") from None
        return cls(**values)


def certified_gap(certificate: Certificate | None) -> float:
    """The relative gap of a valid answer; NaN without one, and for any other answer."""
    if certificate is None or certificate.gap is None or not certificate.valid:
        return math.nan
    return certificate.gap.value


def _outcome_and_claim(info: Mapping[str, Any]) -> dict[str, Any]:
    return {name: info[name] for name in ("outcome", "claim")}


def _reason(solution: Solution) -> str:
    """The checks that fail, and the method's message."""
    failed = () if solution.certificate is None else solution.certificate.failures
    return "; ".join(filter(None, [*failed, solution.message]))
