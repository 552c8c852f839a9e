"""Figures, small pictures of them, and tables of a run for the report, drawn where the executor
runs.
"""

from __future__ import annotations

import io
import re
import struct
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
THUMBNAIL = (240, 180)
"""Largest width and height [pixel]; shown at half that size, so it is sharp on fine screens too."""
COLOURS = 48


@dataclass(frozen=True)
class DrawnFigure:
    """A figure as pixels, which look the same with whatever fonts the reader has.

    ``svg`` is present too if parts of the figure belong to methods that can be shown or hidden.
    """

    name: str
    png: bytes
    svg: bytes | None


@dataclass(frozen=True)
class DrawnRun:
    """Figures and tables of a run; ``missing`` has one sentence for each that could not be made."""

    figures: list[DrawnFigure]
    tables: dict[str, str]
    missing: list[str]


def draw_runs(folders: Sequence[Path], executor: Executor, progress: Progress) -> list[DrawnRun]:
    """Figures and tables of the runs in results folders, one task for each run."""
    return spread(
        partial(_draw_run, added_problems()),
        folders,
        executor,
        progress=progress,
        description="runs drawn",
    )


def _draw_run(problems: Sequence[Path], folder: Path) -> DrawnRun:
    """Figures and tables of a run; each failure leaves a sentence and does not stop the others."""
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
    """An error's text; for a foreign error also the line of the workbench where it occurred."""
    if isinstance(error, WorkbenchError):
        return str(error)
    frames = traceback.extract_tb(error.__traceback__)
    last = [frame for frame in frames if _is_ours(Path(frame.filename))][-1]
    return f"{type(error).__name__}: {error} ({last.filename}:{last.lineno} in {last.name})"


def _is_ours(file: Path) -> bool:
    """Whether a source file belongs to the workbench, which may be installed, or to the user."""
    return file.is_relative_to(LIBRARY) or "site-packages" not in file.parts


def _words(stem: str) -> str:
    """The title of a figure: ``figure-7-13`` is figure 7.13."""
    return re.sub(r"[-_]+", " ", re.sub(r"(?<=\d)-(?=\d)", ".", stem))


def thumbnail(png: bytes) -> bytes:
    """A small picture of a figure, from PNG to PNG; the same figure gives the same bytes."""
    from PIL import Image

    with Image.open(io.BytesIO(png)) as figure:
        small = Image.new("RGB", figure.size, "white")
        small.paste(figure, mask=figure.getchannel("A") if figure.mode == "RGBA" else None)
    small.thumbnail(THUMBNAIL, Image.Resampling.LANCZOS)
    file = io.BytesIO()
    small.quantize(COLOURS).save(file, "PNG", optimize=True)
    return file.getvalue()


def pixels_of(png: bytes) -> tuple[int, int]:
    """Width and height of a PNG [pixel]; a page reserves the space before the figure is loaded."""
    width, height = struct.unpack(">II", png[16:24])
    return width, height
