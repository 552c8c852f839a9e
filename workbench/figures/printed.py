"""Figures for a paper: vector graphics in the width of its page, and PGF if TeX is installed."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from workbench._core.heavy_types import Figure
from workbench.errors import ResultError
from workbench.figures import formats
from workbench.figures.styles import FigureStyle, drawn_in

TEX_PROGRAMS = ("pdflatex", "xelatex", "lualatex")
"""Programs that can measure the letters of a PGF figure, the fastest first."""


def tex_program() -> str | None:
    """The TeX program that is installed here; None if there is none."""
    return next((name for name in TEX_PROGRAMS if shutil.which(name)), None)


@dataclass(frozen=True)
class PrintedFigure:
    """A figure as a paper prints it. A notebook shows it.

    ``caption`` is the figure's title on a screen, above all panels; a paper puts it below.
    """

    name: str
    figure: Figure
    style: FigureStyle
    caption: str = ""

    @cached_property
    def png(self) -> bytes:
        """Pixels, 300 to the inch."""
        return formats.png(self.figure)

    @cached_property
    def svg(self) -> bytes:
        """Vector graphics, letters as paths."""
        return formats.svg(self.figure)

    @cached_property
    def pdf(self) -> bytes:
        """Vector graphics, letters in embedded fonts."""
        with drawn_in(self.style):
            return formats.pdf(self.figure)

    def write_pgf(self, file: str | Path) -> list[Path]:
        r"""Write commands for \input in a LaTeX document, in its own fonts; return the files.

        Pixel images in the figure go into separate files, which the commands name.

        Raises
        ------
        ResultError
            No TeX program is found, so the letters cannot be measured.
        """
        program = tex_program()
        if program is None:
            raise ResultError(
                f"a PGF figure needs LaTeX: put {', '.join(TEX_PROGRAMS[:-1])} or "
                f"{TEX_PROGRAMS[-1]} on the path, or take the PDF"
            )
        with drawn_in(self.style):
            return formats.write_pgf(self.figure, Path(file), program)

    def save(self, folder: str | Path, name: str | None = None) -> list[Path]:
        """Write PDF and SVG, and PGF if a TeX program is found; return the files.

        ``name`` is the stem of the files; by default that of the figure. A missing folder is made.
        """
        place = Path(folder)
        stem = name or self.name
        place.mkdir(parents=True, exist_ok=True)
        files = [place / f"{stem}.pdf", place / f"{stem}.svg"]
        for file, content in zip(files, (self.pdf, self.svg), strict=True):
            file.write_bytes(content)
        return files + (self.write_pgf(place / f"{stem}.pgf") if tex_program() else [])

    def _repr_png_(self) -> bytes:
        return self.png
