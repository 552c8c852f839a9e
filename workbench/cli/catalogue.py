"""Commands that list problems and results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

import workbench
from workbench.bench.project import registry, results_root
from workbench.cli.group import AS_JSON, main, tell_unfit
from workbench.cli.guidance.completion import problem_names
from workbench.cli.terminal import certificate_word, print_json, print_table, row

if TYPE_CHECKING:
    from workbench.bench.results import Run


@main.command("list")
@click.argument("pattern", default="*", shell_complete=problem_names)
@AS_JSON
def list_(pattern: str, as_json: bool) -> None:
    """Names of the problems that fit PATTERN, one line each."""
    entries = registry().match(pattern)
    tell_unfit()
    if as_json:
        rows = [{"name": e.name, "summary": e.summary, "slow": e.slow} for e in entries]
        print_json(rows)
        return
    width = max(len(entry.name) for entry in entries)
    for entry in entries:
        slow = " (slow)" if entry.slow else ""
        click.echo(f"{entry.name:<{width}}  {entry.summary}{slow}")


@main.command()
@click.argument("name", shell_complete=problem_names)
@AS_JSON
def show(name: str, as_json: bool) -> None:
    """Source, help, parameters and methods of a problem."""
    from workbench.bench.describe import describe

    described = describe(registry().find(name))
    if as_json:
        print_json(described.to_json())
    else:
        click.echo(described.text)


@main.command()
@click.argument("name", shell_complete=problem_names)
def cite(name: str) -> None:
    """BibTeX of the software, the thesis and the methods that a problem's results rest on."""
    from workbench.cli.guidance.citation import citation

    click.echo(citation(name))


@main.command()
@click.argument("pattern", default="*", shell_complete=problem_names)
@AS_JSON
def results(pattern: str, as_json: bool) -> None:
    """The stored results of the problems that fit PATTERN.

    Shows when each was made, and those parameters and options that differ from the defaults.
    """
    from workbench.bench.results import damaged

    runs = workbench.results(pattern)
    for folder, reason in damaged(results_root()).items():
        click.echo(f"workbench: left out: {folder}: {reason}", err=True)
    if as_json:
        print_json([row(one) for one in runs])
    elif runs:
        _print_results(runs)
    else:
        registry().match(pattern)  # raises for a name that no problem has
        click.echo(f"no results of {pattern} in {results_root()}; try: workbench run '{pattern}'")


def _print_results(runs: Sequence[Run]) -> None:
    """Print each stored run's date, certificate, and arguments that differ from the defaults."""
    from workbench.cli.departures import departures

    rows = [
        [
            one.problem,
            one.method or "-",
            one.headline,
            certificate_word(one),
            one.info["started"][:16].replace("T", " "),
            " ".join(f"{name}={value}" for name, value in departures(one).items()),
        ]
        for one in runs
    ]
    heads = ["problem", "method", "key metric", "certificate", "started [UTC]", "not default"]
    print_table(heads, rows)
