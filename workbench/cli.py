"""The command line. Exit status 0: every certificate holds; 1: one does not; 2: an error."""

from __future__ import annotations

import os
import sys
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import workbench
from workbench.batch import ended, workers
from workbench.bench.declare import RESERVED_PARAMETERS
from workbench.bench.project import add_problems, registry, results_root, use_results
from workbench.errors import WorkbenchError
from workbench.guidance.completion import method_names, parameter_names, problem_names
from workbench.solvers import Options
from workbench.terminal import (
    print_comparison,
    print_details,
    print_json,
    print_plan,
    print_runs,
    print_sweep,
    row,
    verdict,
)

if TYPE_CHECKING:
    from workbench.bench.results import Run

AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON for a script.")
SCHEDULER = click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Work on the workers of a Dask scheduler, such as tcp://10.0.0.5:8786; or local.",
)


def _cluster(scheduler: str | None, jobs: int) -> AbstractContextManager[Executor | None]:
    """The executor on a scheduler, which is left at the end; None without one."""
    if scheduler is None:
        return nullcontext()
    if scheduler != "local" and jobs > 1:
        raise click.UsageError(f"{scheduler} has its own workers; leave out --jobs")
    return workbench.connect(scheduler, workers=jobs if jobs > 1 else None)


class Commands(click.Group):
    """Errors of the workbench end with their message, not with a traceback."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except WorkbenchError as error:
            click.echo(f"workbench: {error}", err=True)
            sys.exit(2)
        except KeyboardInterrupt:
            click.echo("workbench: interrupted; finished results are kept, and rounds", err=True)
            sys.exit(130)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(
    workbench.__version__,
    prog_name="robust-workbench",
    message=f"%(prog)s %(version)s (workbench at {Path(workbench.__file__).parent})",
)
@click.option(
    "--problems", multiple=True, metavar="DIR", help="Discover problems in this folder too."
)
@click.option("--results", metavar="DIR", help="Keep results here [default: the project's].")
def main(problems: tuple[str, ...], results: str | None) -> None:
    """Named problems of robust control: any solver, every answer certified."""
    for folder in problems:
        add_problems(folder)
    if results:
        use_results(results)


@main.command("list")
@click.argument("pattern", default="*", shell_complete=problem_names)
@AS_JSON
def list_(pattern: str, as_json: bool) -> None:
    """Names of the problems that fit PATTERN, one line each."""
    entries = registry().match(pattern)
    _tell_unfit()
    if as_json:
        rows = [{"name": e.name, "summary": e.summary, "slow": e.slow} for e in entries]
        print_json(rows)
        return
    width = max(len(entry.name) for entry in entries)
    for entry in entries:
        slow = " (slow)" if entry.slow else ""
        click.echo(f"{entry.name:<{width}}  {entry.summary}{slow}")


@main.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "--data", metavar="FILES", required=True, help="A record of each plant: 'drive*.csv'."
)
@click.option("--input", metavar="NAME", help="Column of the input [by its name].")
@click.option("--output", metavar="NAME", help="Column of the output [by its name].")
@click.option("--time", metavar="NAME", help="Column of the instants [s] [the equidistant one].")
@click.option("--sample-rate", type=float, metavar="HZ", help="In place of a column of time.")
@click.option("--period", type=float, metavar="S", help="Of the controller [that of the records].")
@click.option(
    "--delay", type=float, default=1.0, show_default=True, help="Of its computer [samples]."
)
def init(folder: Path, data: str, **given: Any) -> None:
    """Write a study of measured plants to FOLDER, that runs from the records to the C file."""
    from workbench.starter import write_study

    chosen = write_study(folder, data, **given)
    width = max(map(len, chosen.reasons))
    for name, reason in chosen.reasons.items():
        value = getattr(chosen, name)
        told = " to ".join(f"{one:.4g}" for one in (value if name == "band" else [value]))
        click.echo(f"{name:<{width}}  {told:<12}  {reason}")
    click.echo(f"\nnext: cd {folder}; workbench run '{folder.name}/*'   (README.md says more)")


@main.command()
@click.option(
    "--to",
    "folder",
    type=click.Path(path_type=Path),
    default=Path("notebooks"),
    show_default=True,
    help="Where to put them.",
)
def notebooks(folder: Path) -> None:
    """Copy the course, ten Jupyter notebooks, to a folder of yours."""
    from workbench.course import copy_notebooks

    for file in copy_notebooks(folder):
        click.echo(file)
    click.echo(f"\nnext: pip install jupyterlab; jupyter lab {folder}")


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
    from workbench.guidance.citation import citation

    click.echo(citation(name))


@main.command()
@click.option("--no-test", is_flag=True, help="Leave out the self-test of some seconds.")
def doctor(no_test: bool) -> None:
    """Versions, solvers, threads, cache, and a self-test whose answers are certified."""
    from workbench.guidance.doctor import examination

    well = True
    for one in examination(test=not no_test):
        sign = "  " if one.well else "! "
        click.echo(f"{sign}{one.topic:<28}{one.found}")
        if one.advice:
            click.echo(f"{'':30}-> {one.advice}")
        well = well and one.well
    sys.exit(0 if well else 1)


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
@click.option("--time-limit", type=float, help="Seconds for each solve.")
@click.option("--seed", type=int, default=0, help="Seed of the random generator.")
@click.option("--verbose", is_flag=True, help="Let the solver print.")
@click.option("--fresh", is_flag=True, help="Compute anew even where the answer is stored.")
@click.option("--slow", is_flag=True, help="Run problems marked slow too.")
@click.option("--jobs", type=click.IntRange(min=1), default=1, help="Run this many at once.")
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
    parameters = _settings(settings)
    entries = {e.name: e for pattern in patterns for e in registry().match(pattern)}
    _tell_unfit()
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
    with _cluster(scheduler, jobs) as executor:
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
@click.argument("pattern", shell_complete=problem_names)
@click.option("--methods", metavar="A,B,C", help="Methods to compare.", shell_complete=method_names)
@click.option("--all-methods", is_flag=True, help="Compare every method of each problem.")
@click.option("--accuracy", default="low,middle,high", help="Accuracy levels.")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE")
@click.option("--time-limit", type=float, help="Seconds for each cell; it is killed there.")
@click.option("--memory-limit", metavar="SIZE", help="Memory of a cell's process, such as 4GiB.")
@click.option("--repeat", type=click.IntRange(min=1), default=1, help="Time each cell so often.")
@click.option("--jobs", type=click.IntRange(min=1), default=1, help="Run cells in N processes.")
@SCHEDULER
@click.option("--threads", type=click.IntRange(min=1), default=1, help="Threads in each process.")
@click.option("--seed", type=int, default=0, help="Of the methods, and of the cells' order.")
@click.option("--slow", is_flag=True, help="Problems marked slow too.")
@click.option("--light", is_flag=True, help="Keep records of the cells, and no folders.")
@click.option("--fresh", is_flag=True, help="Compute anew even where cells are stored.")
@click.option("--verbose", is_flag=True, help="Let solvers print into the logs of the cells.")
@click.option("--in-process", is_flag=True, help="Run cells in this process, to look for errors.")
@click.option("--plan", is_flag=True, help="Print what would run, and run nothing.")
@click.option("--cells", "table", metavar="FILE", help="Write all cells: .csv, .parquet.")
@click.option("--against", "old", metavar="RUN", help="Say what changed since this comparison.")
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

    A cell is stored when it ends and found again: what was stopped goes on where it was.
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
    # Read now: the new comparison takes the place of an old one that asked the same.
    before = None if old is None else need_comparison(workbench.open_run(old).data.load())
    with _cluster(scheduler, options["jobs"]) as executor:
        asked = asked_for(
            pattern,
            None if methods is None else methods.split(","),
            accuracy.split(","),
            _settings(settings),
            memory_limit=None if memory_limit is None else _size(memory_limit),
            executor=InProcess() if in_process else executor,
            **options,
        )
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


@main.command()
@click.argument("name", shell_complete=problem_names)
@click.option(
    "--over", "axes", multiple=True, required=True, metavar="KEY=A,B,C", help="Values to sweep."
)
@click.option("--method", help="Method [default: the problem's own].")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="Another parameter.")
@click.option("--tolerance", default="middle", help="low, middle, high, or a number.")
@click.option("--time-limit", type=float, help="Seconds for each point.")
@click.option("--seed", type=int, default=0, help="Seed of the random generator.")
@click.option("--jobs", type=click.IntRange(min=1), default=1, help="Run points in N processes.")
@SCHEDULER
@click.option("--fresh", is_flag=True, help="Compute anew even where points are stored.")
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

    Every point is a run of its own, found again: what was stopped goes on where it was.
    """
    given = [_settings((text,)) for text in axes]
    names = [key for one in given for key in one]
    if len(set(names)) < len(names):
        raise click.UsageError(f"--over names a parameter twice: {', '.join(names)}")
    over = {key: value.split(",") for one in given for key, value in one.items()}
    asked = {**options, **_settings(settings)}
    if plan:
        from workbench.sweeps import grid_of

        wanted = Options(options["tolerance"], options["time_limit"], seed=options["seed"])
        grid = grid_of(name, over, method, wanted, _settings(settings), fresh=options["fresh"])
        print_plan(list(grid.axes), grid.planned(), as_json)
        return
    with _cluster(scheduler, options["jobs"]) as executor:
        done = workbench.sweep(name, over, method, executor=executor, **asked)
    print_sweep(done, as_json)
    sys.exit(0 if done.holds else 1)


@main.command()
@click.argument("paths", nargs=-1, type=click.Path(path_type=Path))
@click.option("--rerun", is_flag=True, help="Answer anew as well, and compare the arrays.")
@click.option(
    "--trust", is_flag=True, help="Import the problems of the project that a folder lies in."
)
@AS_JSON
def verify(paths: tuple[Path, ...], rerun: bool, trust: bool, as_json: bool) -> None:
    """Verify results folders at or below PATHS [default: the project's results].

    Checksums, key, arrays, metrics and certificate; the log, the seconds and the method's claim by
    their checksums only.
    """
    from workbench.bench.verify import finished_folders, verify_folder

    found = []
    for path in paths or (results_root(),):
        for folder in finished_folders(path):
            found.append(verify_folder(folder, rerun=rerun, trust=trust))
            if not as_json:
                click.echo(repr(found[-1]))
    if as_json:
        rows = [
            {
                "path": str(one.path),
                "holds": one.holds,
                "problems": list(one.problems),
                "notes": list(one.notes),
            }
            for one in found
        ]
        print_json(rows)
    else:
        click.echo(f"{sum(one.holds for one in found)} of {len(found)} verified")
    sys.exit(0 if all(one.holds for one in found) else 1)


@main.command()
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--to",
    "folder",
    type=click.Path(path_type=Path),
    default=Path("figures"),
    show_default=True,
    help="Where to put them, below a folder for each problem and key.",
)
@click.option(
    "--style",
    type=click.Choice(["screen", "paper"]),
    default="screen",
    show_default=True,
    help="For a screen as SVG and PNG, or for a paper as PDF, SVG and, where LaTeX is found, PGF.",
)
@click.option(
    "--width", default="column", show_default=True, help="On paper: column, page, or a number [mm]."
)
def draw(paths: tuple[Path, ...], folder: Path, style: str, width: str) -> None:
    """Figures and tables (Markdown) of the results folders at or below PATHS."""
    from workbench.bench.results import Run
    from workbench.bench.verify import finished_folders

    for path in paths:
        for found in finished_folders(path):
            one = Run(found)
            place = folder / one.problem / one.key
            for file in one.draw(place, style=style, width=_width(width)):
                click.echo(file)


@main.command()
@click.argument("pattern", default="*", shell_complete=problem_names)
@AS_JSON
def results(pattern: str, as_json: bool) -> None:
    """The stored results of the problems that fit PATTERN."""
    from workbench.bench.results import damaged

    runs = workbench.results(pattern)
    for folder, reason in damaged(results_root()).items():
        click.echo(f"workbench: left out: {folder}: {reason}", err=True)
    if as_json:
        print_json([row(one) for one in runs])
    elif runs:
        print_runs(runs)
    else:
        click.echo(f"no results of {pattern} in {results_root()}; try: workbench run '{pattern}'")


@main.command()
@click.argument("root", required=False, type=click.Path(path_type=Path))
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    help="Folder of the report [ROOT]; with --single-file the page [PROBLEM-KEY.html].",
)
@click.option("--open", "open_", is_flag=True, help="Open it in a browser.")
@click.option(
    "--single-file",
    "single",
    metavar="RUN",
    type=click.Path(path_type=Path),
    help="One run's results folder as one page with its figures inside.",
)
@click.option(
    "--jobs", type=click.IntRange(min=1), help="Draw this many runs at once [default: every core]."
)
def report(
    root: Path | None, output: Path | None, open_: bool, single: Path | None, jobs: int | None
) -> None:
    """Pages over the results below ROOT: an index, and a page for each run and comparison.

    They open from the disk, without a server or a network.
    """
    from workbench.bench.report import single_page
    from workbench.bench.results import damaged

    if single is not None:
        if root is not None:
            raise click.UsageError("--single-file takes the folder of one run; leave ROOT out")
        page = single_page(single, output)
    else:
        with workers(jobs or os.cpu_count() or 1) as executor:
            page = workbench.report(root, output, executor=executor)
        for folder, reason in damaged(root or results_root()).items():
            click.echo(f"workbench: left out: {folder}: {reason}", err=True)
    click.echo(page)
    if open_:
        click.launch(str(page))


def _tell_unfit() -> None:
    """Say which problem files and names are left out, and why."""
    for sentence in registry().unfit:
        click.echo(f"workbench: left out: {sentence}", err=True)


def _width(text: str) -> str | float:
    """A number [mm], or a word for `paper_style` to judge."""
    try:
        return float(text)
    except ValueError:
        return text


_UNITS = {"": 1, "B": 1, "kB": 1000, "MB": 1000**2, "GB": 1000**3}
_UNITS |= {"KiB": 2**10, "MiB": 2**20, "GiB": 2**30}


def _size(text: str) -> int:
    """A number of bytes from a text such as 4GiB."""
    number = text.rstrip("".join(set("".join(_UNITS))) + " ")
    unit = text[len(number) :].strip()
    try:
        return int(float(number) * _UNITS[unit])
    except (ValueError, KeyError, OverflowError):
        units = ", ".join(filter(None, _UNITS))
        raise click.UsageError(f"a size is a number and one of {units}, not {text!r}") from None


def _settings(texts: tuple[str, ...]) -> dict[str, str]:
    """Parameters of the problem from KEY=VALUE; options are no parameters."""
    found = {}
    for text in texts:
        key, equals, value = text.partition("=")
        name = key.strip()
        if not equals or not name:
            raise click.UsageError(f"--set needs KEY=VALUE, not {text!r}")
        if name in RESERVED_PARAMETERS:
            raise click.UsageError(
                f"{name} is an option, not a parameter: --{name.replace('_', '-')}"
            )
        found[name] = value
    return found
