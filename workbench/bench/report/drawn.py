"""Figures and tables of a run as the report shows them, drawn where the work runs."""

from __future__ import annotations

import re
import traceback
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import workbench
from workbench._core.heavy_types import Figure
from workbench.bench.project import add_problems, added_problems
from workbench.bench.report.points import every_cell
from workbench.bench.report.toggles import has_methods, telling
from workbench.bench.results import COMPARISON, Run
from workbench.errors import WorkbenchError
from workbench.executor import Progress, spread
from workbench.figures.formats import png, svg

LIBRARY = Path(workbench.__file__).parent


@dataclass(frozen=True)
class DrawnFigure:
    """A figure as pixels, which look the same whatever fonts the reader has.

    ``svg`` is there as well where parts of the figure belong to methods that can be toggled.
    """

    name: str
    png: bytes
    svg: bytes | None


@dataclass(frozen=True)
class DrawnRun:
    """Figures and tables of a run; ``missing`` has a sentence for what could not be made."""

    figures: list[DrawnFigure]
    tables: dict[str, str]
    missing: list[str]


def draw_runs(folders: Sequence[Path], executor: Executor, progress: Progress) -> list[DrawnRun]:
    """Figures and tables of the runs in results folders, a run to a task."""
    return spread(
        partial(_drawn, added_problems()),
        folders,
        executor,
        progress=progress,
        description="runs drawn",
    )


def _drawn(problems: Sequence[Path], folder: Path) -> DrawnRun:
    """Figures and tables of the run in a folder; what fails leaves a sentence, and the rest."""
    for each in problems:
        add_problems(each)
    run = Run(folder)
    if run.certificate is None:
        return DrawnRun([], {}, [])
    figures: list[DrawnFigure] = []
    tables: dict[str, str] = {}
    missing: list[str] = []
    try:
        drawings = run.answered.drawings(run.answer)
    except Exception as error:
        return DrawnRun([], {}, [f"Figures and tables cannot be made: {_reason(error)}"])
    for part, draw in drawings.items():
        name = part
        try:
            for name, figure in draw().items():
                figures.append(_figure(name, figure))
        except Exception as error:
            missing.append(f"Figure not drawn: {_words(name)}: {_reason(error)}")
    if run.problem == COMPARISON:
        try:
            figure, told = every_cell(run.data)
            figures.append(DrawnFigure("every cell", png(figure), telling(svg(figure), told)))
        except Exception as error:
            missing.append(f"Figure not drawn: every cell: {_reason(error)}")
    try:
        tables = run.tables
    except Exception as error:
        missing.append(f"Tables not made: {_reason(error)}")
    return DrawnRun(figures, tables, missing)


def _figure(stem: str, figure: Figure) -> DrawnFigure:
    return DrawnFigure(_words(stem), png(figure), svg(figure) if has_methods(figure) else None)


def _reason(error: Exception) -> str:
    """An error's words; one that is not ours with the line of ours that met it."""
    if isinstance(error, WorkbenchError):
        return str(error)
    frames = traceback.extract_tb(error.__traceback__)
    last = [frame for frame in frames if _is_ours(Path(frame.filename))][-1]
    return f"{type(error).__name__}: {error} ({last.filename}:{last.lineno} in {last.name})"


def _is_ours(file: Path) -> bool:
    """Whether a source file is the library's, which may be installed, or a user's."""
    return file.is_relative_to(LIBRARY) or "site-packages" not in file.parts


def _words(stem: str) -> str:
    """The name of a figure as people read it: ``figure-7-13`` is figure 7.13."""
    return re.sub(r"[-_]+", " ", re.sub(r"(?<=\d)-(?=\d)", ".", stem))
