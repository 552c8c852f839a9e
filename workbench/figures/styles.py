"""Styles of figures: the workbench's own for a screen, and one for the pages of a paper."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.errors import InputError

MM_PER_INCH = 25.4
WIDTHS = {"column": 88.9, "page": 181.9}
"""Widths [mm] of one column and of both columns of a journal's page (IEEE Transactions)."""
NARROWEST, WIDEST = 40.0, 420.0
"""Least and largest width [mm] that may be given as a number."""

SCREEN: Any = {
    "axes.grid": True,
    "axes.labelsize": 10,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 11,
    "figure.constrained_layout.use": True,
    "axes.formatter.limits": (-3, 5),  # otherwise the labels of small numbers overlap
    "axes.formatter.use_mathtext": True,
    "figure.dpi": 120,
    "font.size": 10,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.6,
    "legend.fontsize": 9,
    "lines.linewidth": 1.3,
    "svg.fonttype": "none",
}
PAPER: Any = {
    **SCREEN,
    "axes.labelsize": 8,
    "axes.linewidth": 0.6,
    "axes.titlesize": 8,
    "figure.dpi": 300,
    "font.family": "STIXGeneral",  # is part of Matplotlib and matches Times
    "font.size": 8,
    "grid.linewidth": 0.4,
    "legend.fontsize": 7,
    "legend.handlelength": 1.6,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.5,
    "mathtext.fontset": "stix",
    "pdf.fonttype": 42,  # publishers refuse the default, Type 3 fonts
    "xtick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.labelsize": 7,
    "ytick.major.width": 0.6,
}

_PANEL_INCHES, _OUTSIDE_INCHES = 1.2, 0.4
"""Least height of a row of panels on paper, and extra height for a legend below them [inch]."""


@dataclass(frozen=True)
class FigureStyle:
    """Settings of Matplotlib, and the width of all figures [inch].

    None: each figure has its own width.
    """

    settings: Any
    width: float | None = None

    def size(self, wanted: tuple[float, float], rows: int) -> tuple[float, float]:
        """Width and height [inch] of a figure with `rows` rows of panels, drawn for size `wanted`.

        The proportions are kept, but panels stay high enough to be read.
        """
        if self.width is None:
            return wanted
        in_proportion = self.width * wanted[1] / wanted[0]
        return self.width, max(in_proportion, rows * _PANEL_INCHES + _OUTSIDE_INCHES)


ON_SCREEN = FigureStyle(SCREEN)
_CURRENT: ContextVar[FigureStyle] = ContextVar("style of figures", default=ON_SCREEN)


def current_style() -> FigureStyle:
    """The style in which figures are drawn now."""
    return _CURRENT.get()


def paper_style(width: str | float) -> FigureStyle:
    """The style of a paper, for figures of this width.

    Parameters
    ----------
    width
        "column", "page", or a number [mm].

    Raises
    ------
    InputError
        Another word; or a number that is no width of a page.
    """
    if isinstance(width, str):
        if width not in WIDTHS:
            raise InputError(
                f"the width of a figure is {', '.join(WIDTHS)} or a number [mm], not {width!r}"
            )
        width = WIDTHS[width]
    if not NARROWEST <= width <= WIDEST:
        raise InputError(
            f"the width of a figure is {NARROWEST:g} to {WIDEST:g} mm, not {width:g} mm"
        )
    return FigureStyle(PAPER, width / MM_PER_INCH)


def printing_style(style: str, width: str | float) -> FigureStyle:
    """The style with this name, for figures of a width as in `paper_style`.

    Raises
    ------
    InputError
        Another name than "paper"; or an impossible width.
    """
    if style != "paper":
        raise InputError(f"figures are printed in style 'paper', not {style!r}")
    return paper_style(width)


@contextmanager
def drawn_in(style: FigureStyle) -> Iterator[None]:
    """Figures are drawn in this style within the block."""
    import matplotlib as mpl

    token = _CURRENT.set(style)
    try:
        with mpl.rc_context(style.settings):
            yield
    finally:
        _CURRENT.reset(token)


def settle(figure: Any) -> str:
    """Prepare a figure that was drawn in a paper's style for its page; return its former title.

    Letters with a size of their own become no larger than the others. A title above all panels is
    removed, since the caption says it. Titles of panels and labels of axes that are longer than
    their panel are broken into lines.
    """
    from matplotlib.text import Text

    caption = " ".join(str(figure.get_suptitle()).split())
    figure.suptitle("").set_in_layout(False)
    largest, smallest = PAPER["font.size"], PAPER["font.size"] - 2
    for text in figure.findobj(Text):
        text.set_fontsize(float(np.clip(text.get_fontsize(), smallest, largest)))
    figure.canvas.draw()
    for panel in figure.axes:
        for text, side in (
            (panel.title, "width"),
            (panel.xaxis.label, "width"),
            (panel.yaxis.label, "height"),
        ):
            _broken_into_lines(text, side, getattr(panel.get_window_extent(), side))
    return caption


def _broken_into_lines(text: Any, side: str, room: float) -> None:
    """A text broken into lines that fit into the length [pixel] that its panel offers."""
    words = text.get_text().split()
    for lines in range(2, 4):
        if not words or getattr(text.get_window_extent(), side) <= room:
            return
        longest = len(" ".join(words)) / lines
        parts: list[str] = [""]
        for word in words:
            if parts[-1] and len(parts[-1]) + len(word) / 2 > longest and len(parts) < lines:
                parts.append(word)
            else:
                parts[-1] = f"{parts[-1]} {word}".strip()
        text.set_text("\n".join(parts))
