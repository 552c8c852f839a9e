"""The group of commands, and the options that several of them have."""

from __future__ import annotations

import itertools
import sys
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import click

import workbench
from workbench.bench.declare import RESERVED_PARAMETERS
from workbench.bench.project import add_problems, registry, use_results
from workbench.errors import WorkbenchError

AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON for a script.")
SCHEDULER = click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Work on the workers of a Dask scheduler, such as tcp://10.0.0.5:8786; or local.",
)


GROUP_OPTIONS = ("--problems", "--results")
"""Options that belong to the group and to no single command."""


def cluster(scheduler: str | None, jobs: int) -> AbstractContextManager[Executor | None]:
    """An executor on a Dask scheduler, closed at the end; None without a scheduler."""
    if scheduler is None:
        return nullcontext()
    if scheduler != "local" and jobs > 1:
        raise click.UsageError(f"{scheduler} has its own workers; leave out --jobs")
    return workbench.connect(scheduler, workers=jobs if jobs > 1 else None)


class Commands(click.Group):
    """An error of the workbench ends the command with its message, without a traceback.

    Options of the group may also follow the command.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        own: list[str] = []
        rest: list[str] = []
        words = iter(args)
        for word in words:
            if word == "--":
                rest += [word, *words]
            elif word.partition("=")[0] in GROUP_OPTIONS:
                own += [word] if "=" in word else [word, *itertools.islice(words, 1)]
            else:
                rest.append(word)
        return super().parse_args(ctx, own + rest)

    def add_command(self, cmd: click.Command, name: str | None = None) -> None:
        cmd.epilog = f"As of every command: {', '.join(GROUP_OPTIONS)} DIR (see `workbench -h`)."
        super().add_command(cmd, name)

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


def tell_unfit() -> None:
    """Print which problem files and names are left out, and why."""
    for sentence in registry().unfit:
        click.echo(f"workbench: left out: {sentence}", err=True)


def settings_of(
    texts: tuple[str, ...], option: str = "--set", value_name: str = "VALUE"
) -> dict[str, str]:
    """Parameters of the problem from texts KEY=VALUE, given by an option of the command.

    Names of options are refused: they are not parameters.
    """
    found = {}
    for text in texts:
        key, equals, value = text.partition("=")
        name = key.strip()
        if not equals or not name:
            raise click.UsageError(f"{option} needs KEY={value_name}, not {text!r}")
        if name in RESERVED_PARAMETERS:
            raise click.UsageError(
                f"{name} is an option, not a parameter: --{name.replace('_', '-')}"
            )
        found[name] = value
    return found
