"""Figures and tables of a run as the report shows them, drawn where the work runs."""

from __future__ import annotations

import base64
import re
import struct
import traceback
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from markupsafe import Markup

from workbench.bench.files import png
from workbench.bench.project import add_problems, added_problems
from workbench.bench.results import Run
from workbench.errors import WorkbenchError
from workbench.executor import Progress, spread


@dataclass(frozen=True)
class Embedded:
    """A figure to embed, as pixels: they look the same whatever fonts the reader has."""

    stem: str
    png: bytes

    @property
    def name(self) -> str:
        return _words(self.stem)

    @property
    def source(self) -> Markup:
        """The pixels as a data URI in base64, in which nothing can be mistaken for markup."""
        code = base64.b64encode(self.png).decode()
        return Markup(f"data:image/png;base64,{code}")  # no character of it needs escaping

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels: the page keeps the room before it draws the figure."""
        width, height = struct.unpack(">II", self.png[16:24])
        return width, height


@dataclass(frozen=True)
class Looks:
    """Figures and tables of a run; ``missing`` has a sentence for what could not be made."""

    figures: list[Embedded]
    tables: dict[str, str]
    missing: list[str]


def looks(folders: Sequence[Path], executor: Executor, progress: Progress) -> list[Looks]:
    """Figures and tables of the runs in results folders, a run to a task."""
    return spread(partial(_looks, added_problems()), folders, executor, progress, "runs drawn")


def _looks(problems: Sequence[Path], folder: Path) -> Looks:
    """Figures and tables of the run in a folder; what fails leaves a sentence, and the rest."""
    for each in problems:
        add_problems(each)
    run = Run(folder)
    if run.certificate is None:
        return Looks([], {}, [])
    figures: list[Embedded] = []
    tables: dict[str, str] = {}
    missing: list[str] = []
    try:
        drawings = run.answered.drawings(run.answer)
    except Exception as error:
        return Looks([], {}, [f"Figures and tables cannot be made: {_reason(error)}"])
    for part, draw in drawings.items():
        name = part
        try:
            for name, figure in draw().items():
                figures.append(Embedded(name, png(figure)))
        except Exception as error:
            missing.append(f"Figure not drawn: {_words(name)}: {_reason(error)}")
    try:
        tables = run.tables
    except Exception as error:
        missing.append(f"Tables not made: {_reason(error)}")
    return Looks(figures, tables, missing)


def _reason(error: Exception) -> str:
    """An error's words; one that is not ours with the line of ours that met it."""
    if isinstance(error, WorkbenchError):
        return str(error)
    frames = traceback.extract_tb(error.__traceback__)
    last = [frame for frame in frames if "site-packages" not in Path(frame.filename).parts][-1]
    return f"{type(error).__name__}: {error} ({last.filename}:{last.lineno} in {last.name})"


def _words(stem: str) -> str:
    """The name of a figure as people read it: ``figure-7-13`` is figure 7.13."""
    return re.sub(r"[-_]+", " ", re.sub(r"(?<=\d)-(?=\d)", ".", stem))
