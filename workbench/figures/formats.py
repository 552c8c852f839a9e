"""Figures as the bytes of a file; the same figure gives the same bytes."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

from workbench._core.heavy_types import Figure
from workbench.figures.limits import mend_limits
from workbench.figures.ticks import house_ticks


def png(figure: Figure) -> bytes:
    """A figure as pixels, at its own resolution, in PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    lay_out(figure)
    file, canvas = io.BytesIO(), cast(Any, FigureCanvasAgg(figure))
    canvas.print_png(file, metadata={"Software": None})
    return file.getvalue()


def svg(figure: Figure) -> bytes:
    """A figure as vector graphics, its letters as paths."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    lay_out(figure)
    file, canvas = io.BytesIO(), cast(Any, FigureCanvasSVG(figure))
    settings: Any = {"svg.hashsalt": "workbench", "svg.fonttype": "path"}
    with mpl.rc_context(settings), _own_resolution(figure):
        canvas.print_svg(file, metadata={"Date": None})
    return file.getvalue()


@contextmanager
def _own_resolution(figure: Figure) -> Iterator[None]:
    """Restore a figure's resolution: vector formats are drawn at 72 points to the inch."""
    resolution = figure.dpi
    try:
        yield
    finally:
        figure.dpi = resolution


def lay_out(figure: Figure) -> None:
    """Lay out the parts of a figure once.

    ``savefig`` would do it twice per format, and draw each time.
    """
    for panel in figure.axes:
        mend_limits(panel)
        house_ticks(panel)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        if any(panel.get_aspect() != "auto" for panel in figure.axes):
            engine.execute(figure)  # The first pass did not know how large the panels become.
        figure.set_layout_engine("none")


def pdf(figure: Figure) -> bytes:
    """A figure as vector graphics for print, with embedded fonts, by the current settings."""
    from matplotlib.backends.backend_pdf import FigureCanvasPdf

    lay_out(figure)
    file, canvas = io.BytesIO(), cast(Any, FigureCanvasPdf(figure))
    with _own_resolution(figure):
        canvas.print_pdf(file, metadata={"CreationDate": None})
    return file.getvalue()


def write_pgf(figure: Figure, file: Path, program: str) -> list[Path]:
    r"""Write commands for \input in LaTeX, letters measured by a TeX program; return the files.

    Pixel images in the figure go into separate files, which the commands name.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_pgf import FigureCanvasPgf

    lay_out(figure)
    canvas = cast(Any, FigureCanvasPgf(figure))
    settings: Any = {"pgf.texsystem": program, "pgf.rcfonts": False}
    with mpl.rc_context(settings), _own_resolution(figure):
        canvas.print_pgf(str(file))
    # Tick labels use a command that only Matplotlib's own LaTeX documents define.
    defined = "\\providecommand{\\mathdefault}[1]{#1}%\n"
    file.write_text(defined + file.read_text(encoding="utf-8"), encoding="utf-8")
    return [file, *sorted(file.parent.glob(f"{file.stem}-img*.png"))]
