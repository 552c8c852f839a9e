"""Commands for the first hour: a study, the course, the state of the installation."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from workbench.cli.group import main


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
    click.echo(f"read: {chosen.columns}")
    width = max(map(len, chosen.reasons))
    for name, reason in chosen.reasons.items():
        value = getattr(chosen, name)
        told = " to ".join(f"{one:.4g}" for one in (value if name == "band" else [value]))
        click.echo(f"{name:<{width}}  {told:<12}  {reason}")
    for note in chosen.notes:
        click.echo(f"! {note}")
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
