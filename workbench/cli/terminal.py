"""Output of the command line: tables, verdicts, JSON."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterable, Sequence
from textwrap import indent
from typing import TYPE_CHECKING, Any

import click

from workbench.bench.project import added_problems
from workbench.solvers import Outcome

if TYPE_CHECKING:
    from workbench._core.heavy_types import Dataset
    from workbench.bench.results import Run


def print_json(value: Any) -> None:
    """Print a value as JSON that every parser accepts."""
    from workbench.bench.question import plain

    click.echo(json.dumps(plain(value), indent=2, allow_nan=False))


def verdict(one: Run) -> str:
    """The outcome of a run and its reason in one line."""
    said = f"certificate {certificate_word(one)}" if one.holds else f"{one.outcome}: {_reason(one)}"
    return said + (" (stored)" if one.reused else "") + (f"; {one.note}" if one.note else "")


def _reason(one: Run) -> str:
    unproven = Outcome(one.info["claim"]).without_answer
    if one.certificate is None or not one.certificate.failures or unproven:
        return str(one.info["message"])
    return "; ".join(one.certificate.failures)


def row(one: Run) -> dict[str, Any]:
    """Data of a run for a script."""
    return {
        "problem": one.problem,
        "method": one.method,
        "key": one.key,
        "outcome": one.outcome,
        "holds": one.holds,
        "reused": one.reused,
        "note": one.note,
        "metrics": one.metrics,
        "seconds": one.seconds,
        "path": str(one.path),
    }


def print_runs(runs: Sequence[Run]) -> None:
    """Problem, method, key metric, certificate and seconds of every run."""
    rows = [
        [
            one.problem,
            one.method or "-",
            one.headline,
            certificate_word(one),
            f"{one.seconds['total']:.2f}",
            "stored" if one.reused else "",
        ]
        for one in runs
    ]
    print_table(
        ["problem", "method", "key metric", "certificate", "seconds", ""], rows, right=1, last=1
    )


def certificate_word(one: Run) -> str:
    """What the certificate of a run says, in one to three words."""
    if one.holds:
        return "holds" if one.outcome is Outcome.SOLVED else f"holds ({one.outcome})"
    return f"best so far ({one.outcome})" if one.best_so_far else f"FAILS ({one.outcome})"


def print_details(one: Run) -> None:
    """Print the certificate of a run, check by check, and the path of its folder."""
    from workbench.bench.notes import own_checks
    from workbench.certificate import VALUE_IS, distinct_texts

    if one.certificate is not None:
        own, others = own_checks(one.certificate, one.info["needs"])
        for check in own:
            click.echo(indent(check.line, "  "))
        if others:
            click.echo(f"  holds  {others} checks of its needs")
        gap = one.certificate.gap
        if gap is not None:
            value, limit = distinct_texts(gap.value, gap.tolerance, digits=3)
            click.echo(f"  optimality gap {value}{f' <= {limit}' if gap.required else ''}")
            click.echo(f"  {VALUE_IS}{gap.statement}")
        for fact in one.certificate.facts:
            click.echo(f"  {fact}")
    if one.info["message"] and (one.certificate is None or one.outcome is not Outcome.SOLVED):
        click.echo(f"  {one.info['message']}")
    if one.outcome is not Outcome.SOLVED:
        click.echo(f"  {one.outcome.advice}")
    if one.reused:
        click.echo("  found among the results; --fresh computes it anew")
    if one.note:
        click.echo(f"  {one.note}")
    click.echo(one.path)


def print_comparison(one: Run, changed: Dataset | None, as_json: bool) -> None:
    """Print a comparison's cells, the failures and how to repeat them, and its folder.

    ``changed`` lists the changes since an older comparison, if one was given.
    """
    from workbench.bench.comparison import (
        HEADS,
        NOT_COMPARED,
        UNFIT,
        alike_methods,
        badge,
        changed_cells,
        changes_table,
        failures,
        left_out,
        rows,
    )

    data = one.data
    if as_json:
        print_json(
            row(one)
            | {"cells": [dict(zip(HEADS, cell, strict=True)) for cell in rows(data)]}
            | ({} if changed is None else {"changed": changed_cells(changed)})
        )
        return
    print_table(HEADS, rows(data), right=6)
    folders = "".join(f" --problems {shlex.quote(str(one))}" for one in added_problems())
    for cell in failures(data)[1]:
        click.echo(f"  {': '.join([' '.join(cell[:3]), *cell[3:5]])}")
        click.echo(f"    {cell[5].strip('`')}{folders}")
    notes = [(outcome, left_out(data, outcome)) for outcome in (UNFIT, NOT_COMPARED)]
    for title, sentences in (*notes, ("alike", alike_methods(data))):
        for sentence in sentences:
            click.echo(f"  {title}: {sentence}")
    if changed is not None:
        click.echo(changes_table(changed))
    click.echo(badge(data))
    click.echo(one.path)


def print_sweep(one: Run, as_json: bool) -> None:
    """Print the points of a sweep, how many of them hold, and the path of its folder."""
    from workbench.bench.parameter_sweep import ParameterSweep

    data = one.data
    if as_json:
        told = data.drop_vars("message").to_dataframe().reset_index().to_dict("records")
        print_json(row(one) | {"points": told})
        return
    click.echo(ParameterSweep.stored().tables(data)["points"])
    found = one.metrics
    held = round(found["certified_share"] * found["points"])
    click.echo(f"certified {held} of {found['points']:g}")
    click.echo(one.path)


def print_plan(
    names: Sequence[str], states: Iterable[tuple[Sequence[Any], str]], as_json: bool
) -> None:
    """Print whether each cell of a comparison, or point of a sweep, is stored or would run."""
    heads, planned = [*names, "state"], [(*labels, state) for labels, state in states]
    if as_json:
        print_json([dict(zip(heads, one, strict=True)) for one in planned])
        return
    print_table(heads, [[*map(str, one)] for one in planned])
    run = sum(one[-1] == "would run" for one in planned)
    click.echo(f"{run} of {len(planned)} would run")


def print_table(
    head: Sequence[str], rows: Sequence[Sequence[str]], *, right: int = 0, last: int = 0
) -> None:
    """Print a plain aligned table.

    Of the columns before the ``last`` ones, the ``right`` hindmost are numbers.
    """
    columns = list(zip(head, *rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    numbers = range(len(head) - last - right, len(head) - last)
    for line in (head, *rows):
        cells = (
            cell.rjust(width) if i in numbers else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        )
        click.echo("  ".join(cells).rstrip())
