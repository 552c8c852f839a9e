"""The command that compares methods."""

from __future__ import annotations

import sys
from typing import Any

import click

import workbench
from workbench.cli.group import AS_JSON, SCHEDULER, cluster, main, settings_of, tell_unfit
from workbench.cli.guidance.completion import method_names, problem_names
from workbench.cli.terminal import print_comparison, print_plan

_UNITS = {"": 1, "B": 1, "kB": 1000, "MB": 1000**2, "GB": 1000**3}
_UNITS |= {"KiB": 2**10, "MiB": 2**20, "GiB": 2**30}


@main.command()
@click.argument("pattern", shell_complete=problem_names)
@click.option("--methods", metavar="A,B,C", help="Methods to compare.", shell_complete=method_names)
@click.option(
    "--all-methods",
    is_flag=True,
    help="Compare every method of each problem but those that are compared only by name.",
)
@click.option("--accuracy", default="low,middle,high", help="Accuracy levels.")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE")
@click.option(
    "--time-limit", type=float, help="Time limit of each cell [s]; it is killed after that."
)
@click.option(
    "--memory-limit", metavar="SIZE", help="Memory limit of a cell's process, such as 4GiB."
)
@click.option(
    "--repeat", type=click.IntRange(min=1), default=1, help="How many times each cell is timed."
)
@click.option("--jobs", type=click.IntRange(min=1), default=1, help="Run cells in N processes.")
@SCHEDULER
@click.option("--threads", type=click.IntRange(min=1), default=1, help="Threads in each process.")
@click.option(
    "--seed", type=int, default=0, help="Seed of the methods, and of the order of the cells."
)
@click.option("--slow", is_flag=True, help="Include problems marked slow.")
@click.option("--light", is_flag=True, help="Keep only records of the cells, no folders.")
@click.option("--fresh", is_flag=True, help="Compute anew even if cells are stored.")
@click.option("--verbose", is_flag=True, help="Let solvers print into the logs of the cells.")
@click.option("--in-process", is_flag=True, help="Run cells in this process, for debugging.")
@click.option("--plan", is_flag=True, help="Print what would run, and run nothing.")
@click.option("--cells", "table", metavar="FILE", help="Write all cells: .csv, .parquet.")
@click.option("--against", "old", metavar="RUN", help="List what changed since this comparison.")
@AS_JSON
def compare(
    pattern: str,
    methods: str | None,
    all_methods: bool,
    accuracy: str,
    settings: tuple[str, ...],
    memory_limit: str | None,
    in_process: bool,
    scheduler: str | None,
    plan: bool,
    table: str | None,
    old: str | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Every problem that fits PATTERN by every method at every accuracy level.

    Each cell is stored when it ends. An interrupted comparison resumes; only new cells are
    computed.
    """
    from workbench.bench.compare import asked_for, described, run_comparison
    from workbench.bench.comparison import changes, need_comparison, need_table_file, write_cells
    from workbench.executor import InProcess
    from workbench.executor.live import shown_live

    if (methods is None) == (not all_methods):
        raise click.UsageError("name --methods A,B,C or ask for --all-methods")
    if plan and (table or old):
        raise click.UsageError("--plan runs nothing; leave out --cells and --against")
    if in_process and scheduler:
        raise click.UsageError("--in-process and --scheduler exclude each other")
    if table is not None:
        need_table_file(table)
    # Read it now: the new comparison replaces an older one of the same question.
    before = None if old is None else need_comparison(workbench.open_run(old).data.load())
    with cluster(scheduler, options["jobs"]) as executor:
        asked = asked_for(
            pattern,
            None if methods is None else methods.split(","),
            accuracy.split(","),
            settings_of(settings),
            memory_limit=None if memory_limit is None else _size(memory_limit),
            executor=InProcess() if in_process else executor,
            **options,
        )
        tell_unfit()
        with shown_live(f"compare {pattern}") as (progress, _):
            if not plan:
                done = run_comparison(pattern, asked, progress)
            else:
                planned = asked.planned(progress)
    if plan:
        names = ("problem", "method", "accuracy", "repetition")
        print_plan(names, described(planned), as_json)
        return
    print_comparison(done, None if before is None else changes(before, done.data), as_json)
    if table is not None:
        write_cells(done.data, table)
    sys.exit(0 if done.metrics["certified_share"] == 1 else 1)


def _size(text: str) -> int:
    """A number of bytes from a text such as 4GiB."""
    number = text.rstrip("".join(set("".join(_UNITS))) + " ")
    unit = text[len(number) :].strip()
    try:
        return int(float(number) * _UNITS[unit])
    except (ValueError, KeyError, OverflowError):
        units = ", ".join(filter(None, _UNITS))
        raise click.UsageError(f"a size is a number and one of {units}, not {text!r}") from None
