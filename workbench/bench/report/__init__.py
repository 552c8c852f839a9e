"""A report of results: a folder of pages that opens from the disk, without network or server.

The pages show the stored results. Nothing is recomputed, and the same folders give the same pages.
"""

from __future__ import annotations

import base64
from concurrent.futures import Executor
from pathlib import Path

from filelock import FileLock
from markupsafe import Markup

from workbench.bench.project import results_root
from workbench.bench.report.drawn import DrawnFigure, draw_runs, pixels_of
from workbench.bench.report.entries import (
    ReportEntry,
    entries,
    entry_of,
    failed_runs,
    places,
)
from workbench.bench.report.kept import ENTRY, KeptRun, ReportFolder, write_whole
from workbench.bench.report.pages import FigureView, RunView, index_page, link, run_page
from workbench.bench.report.stamps import drawing_code, stamps
from workbench.bench.report.toggles import Toggled, toggled
from workbench.bench.results import damaged, open_run, unreadable
from workbench.bench.store import CHECKSUMS
from workbench.bench.trust.untrusted import own_file, possible_path
from workbench.errors import ResultError
from workbench.executor import InProcess, Progress, no_progress
from workbench.executor.live import shown_live

__all__ = ["failed_runs", "report", "single_page"]


def report(
    root: str | Path | None = None,
    *,
    output: str | Path | None = None,
    pattern: str = "*",
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write the runs below a results folder, including failures, as a folder of pages.

    The figures of a run are drawn once; they are redrawn only if its folder, a result that it
    needs, or the code has changed.

    Parameters
    ----------
    root
        The results folder (default: the project's).
    output
        The folder of the report (default: the results folder): its start page is ``index.html``,
        its other files are below ``report``.
    pattern
        Shell pattern of the problems to show.
    executor
        Where the figures are drawn, one task for each run (default: in this process).
    progress
        Called with the number of runs that are drawn. None: shown at a terminal or in a notebook.

    Returns
    -------
    Path of the start page. Every page appears whole or not at all; the start page is written last,
    so an interrupted report leaves the earlier one in use.

    Raises
    ------
    ResultError
        ``root`` is given and is not a folder or has no results; the report cannot be written there;
        or a results folder cannot be read.
    """
    chosen = root is not None
    root = possible_path(root) if root is not None else results_root()
    output = possible_path(output) if output is not None else root
    if chosen and not root.is_dir():
        raise ResultError(f"{root} is no folder; a results folder is needed")
    _outside_of_results(output / ENTRY)
    shown = entries(root, pattern)
    left_out = damaged(root)
    if chosen and not shown and not left_out and not entries(root):
        raise ResultError(f"{root} has no results below it; a results folder is needed")
    place = ReportFolder(output)
    # only one report at a time may be written in a folder
    locked = FileLock(output / "report" / ".lock")
    with locked, shown_live("report") as (bar, _):
        kept = _draw_new_runs(place, shown, executor or InProcess(), progress or bar)
        where = places(shown)
        for entry in shown:
            write_whole(place.page(entry.stem), [_page(place, entry, kept[entry.stem], where)])
        small = {stem: one.thumbnail for stem, one in kept.items() if one.thumbnail}
        thumbnails = {
            stem: FigureView("", f"report/figures/{one.png}", one.width // 2, one.height // 2)
            for stem, one in small.items()
        }
        reasons = {
            folder.relative_to(root).as_posix(): reason for folder, reason in left_out.items()
        }
        write_whole(place.entry, [index_page(shown, thumbnails, pattern, reasons)])
        place.tidy(kept)
    return place.entry


def single_page(run: str | Path, output: str | Path | None = None) -> Path:
    """Write one run as a single self-contained page with its figures inside.

    Parameters
    ----------
    run
        The run's results folder.
    output
        The page (default: a file in the working folder, named after problem and key).

    Returns
    -------
    Path of the page. It appears whole or not at all.

    Raises
    ------
    ResultError
        The folder is damaged or not a results folder; or the page cannot be written there.
    """
    found = open_run(run)
    wrong = unreadable(found.path)
    if wrong:
        raise ResultError(f"{found.path}: {wrong}")
    entry = entry_of(found)
    name = f"{entry.anchor.replace('/', '-')}.html"
    target = possible_path(output) if output is not None else Path(name)
    if target.is_dir():
        raise ResultError(f"{target} is a folder; the name of a page is needed: {target / name}")
    _outside_of_results(target)
    (drawn,) = draw_runs([found.path], InProcess(), no_progress)
    inline = [_inline(one.svg, f"f{place}-") for place, one in enumerate(drawn.figures)]
    figures = [
        FigureView(one.name, _embedded(one), *pixels_of(one.png), svg.markup if svg else None)
        for one, svg in zip(drawn.figures, inline, strict=True)
    ]
    methods = _methods(inline)
    view = RunView(entry, figures, methods, drawn.tables, drawn.missing, {}, None, None)
    write_whole(target, [run_page(view)])
    return target


def _draw_new_runs(
    place: ReportFolder, shown: list[ReportEntry], executor: Executor, progress: Progress
) -> dict[str, KeptRun]:
    """Figures and tables of all runs by the names of their pages; only new ones are drawn."""
    stamp = stamps({entry.run.path: entry.run for entry in shown}, drawing_code())
    found = {entry.stem: place.kept(entry.stem, stamp[entry.run.path]) for entry in shown}
    stale = [entry for entry in shown if found[entry.stem] is None]
    drawn = draw_runs([entry.run.path for entry in stale], executor, progress)
    for entry, one in zip(stale, drawn, strict=True):
        found[entry.stem] = place.keep(entry.stem, stamp[entry.run.path], one)
    return {stem: one for stem, one in found.items() if one is not None}


def _page(place: ReportFolder, entry: ReportEntry, kept: KeptRun, where: dict[str, str]) -> str:
    """The page of a run in the report's folder."""
    inline = []
    for number, one in enumerate(kept.figures):
        vectors = own_file(place.figure(one.svg)).read_bytes() if one.svg else None
        inline.append(_inline(vectors, f"f{number}-"))
    figures = [
        FigureView(
            one.name, f"../figures/{one.png}", one.width, one.height, svg.markup if svg else None
        )
        for one, svg in zip(kept.figures, inline, strict=True)
    ]
    start = place.page(entry.stem).parent
    view = RunView(
        entry,
        figures,
        _methods(inline),
        kept.tables,
        kept.missing,
        where,
        link(entry.run.path, start),
        f"../../{ENTRY}",
    )
    return run_page(view)


def _inline(vectors: bytes | None, prefix: str) -> Toggled | None:
    """A figure as SVG to put into a page; None if there is none, or if it cannot be used."""
    if vectors is None:
        return None
    try:
        return toggled(vectors, prefix)
    except ValueError:  # the PNG is shown instead
        return None


def _methods(figures: list[Toggled | None]) -> list[str]:
    return list(dict.fromkeys(name for one in figures if one for name in one.methods))


def _embedded(figure: DrawnFigure) -> Markup:
    """A PNG as a data URI in base64, which cannot be mistaken for markup."""
    code = base64.b64encode(figure.png).decode()
    return Markup(f"data:image/png;base64,{code}")


def _outside_of_results(target: Path) -> None:
    if any((folder / CHECKSUMS).exists() for folder in target.absolute().parents):
        raise ResultError(
            f"{target} would lie in a sealed results folder and break its checksums: "
            "name another place with --output"
        )
