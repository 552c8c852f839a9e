"""Commands that read results folders: verify, draw, report."""

from __future__ import annotations

import os
import sys
from dataclasses import asdict
from pathlib import Path

import click

import workbench
from workbench.bench.project import results_root
from workbench.cli.batch import workers
from workbench.cli.group import AS_JSON, main
from workbench.cli.terminal import print_json


@main.command()
@click.argument("paths", nargs=-1, type=click.Path(path_type=Path))
@click.option("--rerun", is_flag=True, help="Answer anew as well, and compare the arrays.")
@click.option(
    "--trust", is_flag=True, help="Import the problems of the project that a folder lies in."
)
@click.option(
    "--deep",
    is_flag=True,
    help="Ask for the dear checks of the second opinion, and certify every cell of a comparison.",
)
@AS_JSON
def verify(paths: tuple[Path, ...], rerun: bool, trust: bool, deep: bool, as_json: bool) -> None:
    """Verify results folders at or below PATHS [default: the project's results].

    Verifies checksums, key, arrays, metrics and certificate; the log, the seconds and the method's
    claim by their checksums only. With --deep each check of the second opinion is also made with
    more draws, samples and frequencies, and listed by name.
    """
    from workbench.bench.verify import finished_folders, verify_folder

    found = []
    for path in paths or (results_root(),):
        for folder in finished_folders(path):
            found.append(verify_folder(folder, rerun=rerun, trust=trust, deep=deep))
            if not as_json:
                click.echo(repr(found[-1]))
    if as_json:
        rows = [
            {
                "path": str(one.path),
                "holds": one.holds,
                "problems": list(one.problems),
                "notes": list(one.notes),
                "deep": [asdict(check) | {"holds": check.holds} for check in one.deep],
            }
            for one in found
        ]
        print_json(rows)
    else:
        click.echo(f"{sum(one.holds for one in found)} of {len(found)} verified")
    sys.exit(0 if all(one.holds for one in found) else 1)


@main.command()
@click.argument("paths", nargs=-1, type=click.Path(path_type=Path))
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
    "--width", help="With --style paper: column, page, or a number [mm] [default: column]."
)
def draw(paths: tuple[Path, ...], folder: Path, style: str, width: str | None) -> None:
    """Figures and tables (Markdown) of results folders at or below PATHS [default: all results]."""
    from workbench.bench.results import Run
    from workbench.bench.verify import finished_folders

    if width is not None and style == "screen":
        raise click.UsageError(f"--width {width} has no effect on a screen: add --style paper")
    for path in paths or (results_root(),):
        for found in finished_folders(path):
            one = Run(found)
            place = folder / one.problem / one.key
            for file in one.draw(place, style=style, width=_width(width or "column")):
                click.echo(file)


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
            page = workbench.report(root, output=output, executor=executor)
        for folder, reason in damaged(root or results_root()).items():
            click.echo(f"workbench: left out: {folder}: {reason}", err=True)
    click.echo(page)
    if open_:
        click.launch(str(page))


def _width(text: str) -> str | float:
    """A number [mm], or a word, which `paper_style` checks."""
    try:
        return float(text)
    except ValueError:
        return text
