"""How a cell ended: what the table of a comparison has of it."""

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
"""The part of run.json that only cells have."""


@dataclass(frozen=True)
class Record:
    """How a cell ended.

    ``objective`` is that of a valid answer, to be minimised; ``scale`` what differences of it are
    relative to, ``rounding`` what rounding may change of it; ``gap`` its certified relative
    distance from the best (`certified_gap`). Wall times of statement, solve and check, CPU time of
    the first two [s]; the largest resident memory of the process meanwhile [byte]. NaN stands for
    what there is not.
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
        """The record of a judged answer."""
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
        """The record of a cell whose worker, or whose task, did not come to an end.

        Its outcome stands as its claim too, as in the folder that `store_lost` leaves.
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
        return cls.from_json({**run.info.get(CELL, {}), **_said(run.info)}, str(run.path))

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, stored: Mapping[str, Any], place: str) -> Record:
        """A record read back; numbers may be the names of those that JSON has not."""
        try:
            values: dict[str, Any] = {
                one.name: float(stored[one.name]) if one.type == "float" else stored[one.name]
                for one in fields(cls)
            }
        except (KeyError, TypeError, ValueError) as error:
            raise ResultError(f"{place} holds no cell: {type(error).__name__} {error}") from None
        return cls(**values)


def certified_gap(certificate: Certificate | None) -> float:
    """The relative gap of a valid answer; NaN without one. Of another answer it says nothing."""
    if certificate is None or certificate.gap is None or not certificate.valid:
        return math.nan
    return certificate.gap.value


def _said(info: Mapping[str, Any]) -> dict[str, Any]:
    return {name: info[name] for name in ("outcome", "claim")}


def _reason(solution: Solution) -> str:
    """The checks that fail, and what the method said."""
    failed = () if solution.certificate is None else solution.certificate.failures
    return "; ".join(filter(None, [*failed, solution.message]))
