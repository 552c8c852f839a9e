"""Commands that run problems."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

import workbench
from workbench.bench.project import registry
from workbench.cli.batch import ended
from workbench.cli.group import AS_JSON, SCHEDULER, cluster, main, settings_of, tell_unfit
from workbench.cli.guidance.completion import method_names, parameter_names, problem_names
from workbench.cli.terminal import (
    print_details,
    print_json,
    print_plan,
    print_runs,
    print_sweep,
    row,
    verdict,
)
from workbench.errors import WorkbenchError
from workbench.solvers import Options

if TYPE_CHECKING:
    from workbench.bench.results import Run


@main.command()
@click.argument("patterns", nargs=-1, required=True, shell_complete=problem_names)
@click.option("--method", help="Method [default: the problem's own].", shell_complete=method_names)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="A parameter of the problem.",
    shell_complete=parameter_names,
)
@click.option("--tolerance", default="middle", help="low, middle, high, or a number.")
@click.option(
    "--time-limit", type=float, help="Time limit of each solve [s], for methods that heed it."
)
@click.option("--seed", type=int, default=0, help="Seed of the random generator.")
@click.option("--verbose", is_flag=True, help="Let the solver print.")
@click.option("--fresh", is_flag=True, help="Compute anew even if the answer is stored.")
@click.option("--slow", is_flag=True, help="Also run problems marked slow.")
@click.option(
    "--jobs", type=click.IntRange(min=1), default=1, help="Number of problems that run at once."
)
@SCHEDULER
@AS_JSON
def run(
    patterns: tuple[str, ...],
    method: str | None,
    settings: tuple[str, ...],
    tolerance: str,
    time_limit: float | None,
    seed: int,
    verbose: bool,
    fresh: bool,
    slow: bool,
    jobs: int,
    scheduler: str | None,
    as_json: bool,
) -> None:
    """Run every problem that fits one of PATTERNS, and leave a results folder for each."""
    if verbose and as_json:
        raise click.UsageError("--verbose lets solvers print what is no JSON; leave out one")
    if verbose and jobs > 1:
        raise click.UsageError("--verbose lets solvers print all at once; leave out it or --jobs")
    parameters = settings_of(settings)
    entries = {e.name: e for pattern in patterns for e in registry().match(pattern)}
    registry().import_methods()
    tell_unfit()
    chosen = [e.name for e in entries.values() if slow or not e.slow or e.name in patterns]
    if not chosen:
        raise click.UsageError("every problem that fits is marked slow; add --slow to run them")
    asked = {
        "method": method,
        "tolerance": tolerance,
        "time_limit": time_limit,
        "seed": seed,
        "verbose": verbose,
        "fresh": fresh,
        **parameters,
    }
    runs: list[Run] = []
    failed = False
    with cluster(scheduler, jobs) as executor:
        for position, (name, done) in enumerate(ended(chosen, asked, jobs, executor), start=1):
            if isinstance(done, WorkbenchError):
                prefix = "" if name in str(done) else f"{name}: "
                click.echo(f"workbench: {prefix}{done}", err=True)
                failed = True
                continue
            runs.append(done)
            if not as_json and len(chosen) > 1:
                click.echo(f"[{position}/{len(chosen)}] {name}: {verdict(done)}", err=True)
    runs.sort(key=lambda one: chosen.index(one.problem))
    if as_json:
        print_json([row(one) for one in runs])
    elif runs:
        print_runs(runs)
        if len(runs) == 1:
            print_details(runs[0])
    if failed:
        sys.exit(2)
    sys.exit(0 if all(one.holds for one in runs) else 1)


@main.command()
@click.argument("name", shell_complete=problem_names)
@click.option(
    "--over", "axes", multiple=True, required=True, metavar="KEY=A,B,C", help="Values to sweep."
)
@click.option("--method", help="Method [default: the problem's own].")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="Another parameter.")
@click.option("--tolerance", default="middle", help="low, middle, high, or a number.")
@click.option("--time-limit", type=float, help="Time limit of each point [s].")
@click.option("--seed", type=int, default=0, help="Seed of the random generator.")
@click.option("--jobs", type=click.IntRange(min=1), default=1, help="Run points in N processes.")
@SCHEDULER
@click.option("--fresh", is_flag=True, help="Compute anew even if points are stored.")
@click.option("--plan", is_flag=True, help="Print what would run, and run nothing.")
@AS_JSON
def sweep(
    name: str,
    axes: tuple[str, ...],
    method: str | None,
    settings: tuple[str, ...],
    scheduler: str | None,
    plan: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Run a problem over a grid of its parameters: one labelled dataset, table and figure.

    Each point is a run of its own and is stored. An interrupted sweep resumes; only new points are
    computed.
    """
    given = [settings_of((text,), "--over", "A,B,C") for text in axes]
    names = [key for one in given for key in one]
    if len(set(names)) < len(names):
        raise click.UsageError(f"--over names a parameter twice: {', '.join(names)}")
    over = {key: value.split(",") for one in given for key, value in one.items()}
    asked = {**options, **settings_of(settings)}
    if plan:
        from workbench.bench.run_sweep import grid_of

        wanted = Options(
            tolerance=options["tolerance"], time_limit=options["time_limit"], seed=options["seed"]
        )
        grid = grid_of(name, over, method, wanted, settings_of(settings), fresh=options["fresh"])
        print_plan(list(grid.axes), grid.planned(), as_json)
        return
    with cluster(scheduler, options["jobs"]) as executor:
        done = workbench.sweep(name, over, method=method, executor=executor, **asked)
    print_sweep(done, as_json)
    sys.exit(0 if done.holds else 1)
