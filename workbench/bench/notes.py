"""The notes and the log of a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from textwrap import indent
from typing import Any

from workbench._core.heavy_types import Dataset
from workbench.bench.checkpoint import FileCheckpoint
from workbench.bench.formats import netcdf
from workbench.bench.results import Run
from workbench.certificate import Certificate, Check
from workbench.executor import Row, row_entry
from workbench.solution import Solution
from workbench.solvers import Options, Outcome


def went_on(solution: Solution, checkpoint: FileCheckpoint) -> list[str]:
    """Notes on an iteration that was resumed, or that can be resumed."""
    notes = []
    if checkpoint.earlier:
        notes.append(f"went on where a run was stopped after {checkpoint.earlier:.3g} s")
    if solution.outcome is Outcome.TIME_LIMIT and checkpoint.kept:
        notes.append("its rounds are kept: asked again, with any time limit, it goes on from there")
    return notes


def compared(earlier: Run | None, data: Dataset, options: Options) -> list[str]:
    """A note on whether the arrays agree with those of an earlier answer, if there is one."""
    if earlier is None:
        return []
    found = netcdf.differences(earlier.data, data, options.accuracy)
    if not found:
        return [f"recomputed; agrees with the earlier answer within {options.accuracy:g}"]
    return ["recomputed; differs from the earlier answer: " + "; ".join(found)]


def own_checks(certificate: Certificate, needs: Iterable[str]) -> tuple[list[Check], int]:
    """The checks of a run itself and those of its needs that fail; the number of the others, of
    which the runs of the needs tell.
    """
    starts = tuple(f"{name}{mark}" for name in needs for mark in ":[")
    own = [c for c in certificate.checks if not (c.name.startswith(starts) and c.holds)]
    return own, len(certificate.checks) - len(own)


def log(
    info: Mapping[str, Any], solution: Solution, rows: Sequence[Row], notes: Sequence[str]
) -> str:
    """Question, rounds, claim, certificate and notes as lines of text."""
    lines = [
        f"{info['problem']} {info['parameters']}",
        f"method {info['method'] or '-'}, options {info['options']}",
        *(", ".join(f"{name} {row_entry(value)}" for name, value in row.items()) for row in rows),
        f"claim: {solution.claim}. {solution.message}",
        f"outcome: {solution.outcome}. {solution.outcome.advice}",
    ]
    if solution.certificate is not None:
        own, others = own_checks(solution.certificate, info["needs"])
        lines += [indent(check.line, "  ") for check in own]
        lines += [f"  holds  {others} checks of its needs"] if others else []
        gap = solution.certificate.gap
        if gap is not None:
            lines.append(f"  gap {gap.value:.3g} ({gap.statement})")
    lines += notes
    if solution.trace:
        lines.append(solution.trace)
    return "\n".join(lines) + "\n"
