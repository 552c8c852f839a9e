"""Styles that figures are drawn in: the house's on a screen, and one for the pages of a paper."""

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
"""Widths [mm] of a column and of both columns of a journal's page (IEEE Transactions)."""
NARROWEST, WIDEST = 40.0, 420.0
"""Limits of a width [mm] that is given as a number: narrower is no figure, wider no page."""

SCREEN: Any = {
    "axes.grid": True,
    "axes.labelsize": 10,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 11,
    "figure.constrained_layout.use": True,
    "axes.formatter.limits": (-3, 5),  # else the labels of small numbers run into each other
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
    "font.family": "STIXGeneral",  # comes with Matplotlib and goes with Times
    "font.size": 8,
    "grid.linewidth": 0.4,
    "legend.fontsize": 7,
    "legend.handlelength": 1.6,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.5,
    "mathtext.fontset": "stix",
    "pdf.fonttype": 42,  # publishers refuse the default, Type 3
    "xtick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.labelsize": 7,
    "ytick.major.width": 0.6,
}

_PANEL_INCHES, _OUTSIDE_INCHES = 1.2, 0.4
"""Least height on paper of a row of panels, and what is added for a legend below them [inch]."""


@dataclass(frozen=True)
class FigureStyle:
    """Settings of Matplotlib, and the width [inch] that figures have; None: each its own."""

    settings: Any
    width: float | None = None

    def size(self, wanted: tuple[float, float], rows: int) -> tuple[float, float]:
        """Width and height [inch] of a figure of so many rows that asks for a size of its own.

        It keeps its proportions, but its panels do not get flatter than can be read.
        """
        if self.width is None:
            return wanted
        in_proportion = self.width * wanted[1] / wanted[0]
        return self.width, max(in_proportion, rows * _PANEL_INCHES + _OUTSIDE_INCHES)


ON_SCREEN = FigureStyle(SCREEN)
_CURRENT: ContextVar[FigureStyle] = ContextVar("style of figures", default=ON_SCREEN)


def current_style() -> FigureStyle:
    """The style that figures are drawn in now."""
    return _CURRENT.get()


def paper_style(width: str | float) -> FigureStyle:
    """The style of a paper, for figures of a width.

    Parameters
    ----------
    width
        "column", "page", or a number [mm].

    Raises
    ------
    InputError
        Another word; a number that is no width of a page.
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
    """The style of a name, for figures of a width, as `paper_style` takes it.

    Raises
    ------
    InputError
        Another name than "paper"; a width that no figure has.
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
    """Make a figure that was drawn in the style of a paper ready for its page; the caption it had.

    Letters that were given a size of their own become no larger than the others. A title over all
    panels is taken away, since a caption says it; titles of panels and labels of axes that are
    longer than their panel are broken into lines.
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
            _broken(text, side, getattr(panel.get_window_extent(), side))
    return caption


def _broken(text: Any, side: str, room: float) -> None:
    """Break a text into lines that fit into the room [pixel] which its panel has for it."""
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
