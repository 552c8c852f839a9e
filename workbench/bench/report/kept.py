"""The files of a report: pages, figures, and records that avoid drawing anything twice.

    DIR/index.html                 the entry, written last
    DIR/report/runs/<run>.html     a page per run
    DIR/report/figures/<hash>.*    figures, named by their content
    DIR/report/kept/<run>.json     which figures and tables a run has, and for which state of it

Every file appears whole. A figure is never changed, and a figure that no page shows is deleted only
after the new start page is in place. So an interrupted report leaves the earlier one as it was, or
pages of both. The records are not trusted: they are checked when read, and escaped when shown.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from workbench.bench.report.drawn import DrawnRun, pixels_of, thumbnail
from workbench.bench.trust.untrusted import read_json
from workbench.errors import ResultError

ENTRY, FOLDER = "index.html", "report"
PARTS = {"runs": r"[\w-]+\.html", "figures": r"[0-9a-f]{24}\.(png|svg)", "kept": r"[\w-]+\.json"}
"""Folders of a report, and patterns for the names of its own files."""
MARK = '<meta name="generator" content="workbench report">'
"""Mark in the head of every page; a file of the same name without the mark is never replaced."""
_OLDER = "<title>Workbench results"

_Name = Annotated[str, Field(pattern=f"^{PARTS['figures']}$")]
_Pixels = Annotated[int, Field(ge=1, le=100_000)]


class KeptFigure(BaseModel):
    """A figure: its name, its files, its width and height [pixel]."""

    model_config = ConfigDict(strict=True, frozen=True)

    name: str
    png: _Name
    svg: _Name | None
    width: _Pixels
    height: _Pixels


class KeptRun(BaseModel):
    """Figures and tables of a run, with the stamp of the state that they show."""

    model_config = ConfigDict(strict=True, frozen=True)

    stamp: str
    figures: list[KeptFigure]
    thumbnail: KeptFigure | None
    tables: dict[str, str]
    missing: list[str]

    @property
    def files(self) -> set[str]:
        """File names of its figures."""
        shown = [*self.figures, *([self.thumbnail] if self.thumbnail else [])]
        return {file for figure in shown for file in (figure.png, figure.svg) if file}


class ReportFolder:
    """The files of a report below a folder.

    Raises
    ------
    ResultError
        A folder of the report is a link, which could lead elsewhere, or cannot be made; or its
        start page exists and was not written by a report.
    """

    def __init__(self, place: Path) -> None:
        self.entry = place / ENTRY
        self.parts = {part: place / FOLDER / part for part in PARTS}
        for folder in (place / FOLDER, *self.parts.values()):
            if folder.is_symlink():
                raise ResultError(f"{folder} is a link: a report is not written through links")
        if self.entry.exists() and not _is_ours(self.entry):
            raise ResultError(
                f"{self.entry} is there and no report has written it: name another folder"
            )
        try:
            for folder in self.parts.values():
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ResultError(f"cannot write the report in {place}: {error}") from None

    def page(self, stem: str) -> Path:
        return self.parts["runs"] / f"{stem}.html"

    def figure(self, name: str) -> Path:
        return self.parts["figures"] / name

    def kept(self, stem: str, stamp: str) -> KeptRun | None:
        """The record of a run, if it shows this state and all its figures exist."""
        file = self.parts["kept"] / f"{stem}.json"
        if not file.exists():
            return None
        try:
            found = KeptRun.model_validate(read_json(file))
        except (ResultError, ValidationError):
            return None
        whole = all(self.figure(name).is_file() for name in found.files)
        return found if found.stamp == stamp and whole else None

    def keep(self, stem: str, stamp: str, drawn: DrawnRun) -> KeptRun:
        """Write the figures of a run, then their record."""
        figures = [self._written(one.name, one.png, one.svg) for one in drawn.figures]
        first = drawn.figures[0] if drawn.figures else None
        small = self._written(first.name, thumbnail(first.png), None) if first else None
        kept = KeptRun(
            stamp=stamp,
            figures=figures,
            thumbnail=small,
            tables=drawn.tables,
            missing=drawn.missing,
        )
        text = json.dumps(kept.model_dump(), ensure_ascii=True, indent=1)
        write_whole(self.parts["kept"] / f"{stem}.json", text.encode())
        return kept

    def _written(self, name: str, pixels: bytes, vectors: bytes | None) -> KeptFigure:
        width, height = pixels_of(pixels)
        drawn = self._figure(vectors, "svg") if vectors else None
        pixelled = self._figure(pixels, "png")
        return KeptFigure(name=name, png=pixelled, svg=drawn, width=width, height=height)

    def _figure(self, content: bytes, kind: str) -> str:
        name = f"{hashlib.sha256(content).hexdigest()[:24]}.{kind}"
        write_whole(self.figure(name), content)
        return name

    def tidy(self, shown: dict[str, KeptRun]) -> None:
        """Delete the report's files that none of these runs needs.

        The runs are given by their pages.
        """
        needed = {
            "runs": {f"{stem}.html" for stem in shown},
            "kept": {f"{stem}.json" for stem in shown},
            "figures": {name for one in shown.values() for name in one.files},
        }
        for part, folder in self.parts.items():
            ours = re.compile(rf"{PARTS[part]}|\.{PARTS[part]}\.\d+")
            for file in folder.iterdir():
                if ours.fullmatch(file.name) and file.name not in needed[part]:
                    with suppress(OSError):
                        file.unlink()


def write_whole(file: Path, content: bytes | Iterable[str]) -> None:
    """Write a temporary file, then rename it; so nobody ever reads half a new file.

    A file that has this content already is not touched.

    Raises
    ------
    ResultError
        The file cannot be written there.
    """
    whole = content if isinstance(content, bytes) else "".join(content).encode("utf-8")
    partial = file.with_name(f".{file.name}.{os.getpid()}")
    try:
        if not file.is_symlink() and file.is_file() and file.read_bytes() == whole:
            return
        file.parent.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(whole)
        partial.replace(file)
    except OSError as error:
        reason = f"{error.strerror}: {error.filename}"
        raise ResultError(f"cannot write the page {file}: {reason}") from None
    finally:
        with suppress(OSError):
            partial.unlink()


def _is_ours(file: Path) -> bool:
    """Whether a page was written by a report, by this version or an older one."""
    try:
        with file.open(encoding="utf-8", errors="replace") as page:
            head = page.read(4096)
    except OSError:
        return False
    return MARK in head or _OLDER in head
