"""Block diagrams in one style: blocks, sums, and wires with the names of their signals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Literal

from workbench._core.heavy_types import Figure
from workbench.errors import InputError
from workbench.figures.panels import BLACK, axes

Point = tuple[float, float]
SUM_RADIUS, DOT_RADIUS = 0.16, 0.05
"""Radii of a sum and of a branch point, in units of the diagram; a block has height 1."""
INCHES = 0.62
"""Size of the diagram's unit on a screen [inch]."""
FILL = "#eef3fa"
MOST_NAMED, MOST_LETTERS = 4, 16
"""Largest number of signals named at one wire, and of letters in a line above a wire.

If a wire has more signals, the first and the last are named.
"""

DiagramKind = Literal["N-Delta", "P-K", "two degrees of freedom", "sampled", "fault filter"]


class BlockDiagram:
    """A drawing of ``width`` by ``height`` units; the origin is at the lower left."""

    def __init__(self, width: float, height: float) -> None:
        self.figure, (self.panel,) = axes(1, 1, size=(INCHES * width, INCHES * height))
        self.panel.set_axis_off()
        self.panel.set_xlim(0, width)
        self.panel.set_ylim(0, height)
        self.panel.set_aspect("equal")

    def block(self, x: float, y: float, text: str, width: float = 1.6, height: float = 1.0) -> None:
        """A block centred at (x, y)."""
        from matplotlib.patches import Rectangle

        corner = (x - width / 2, y - height / 2)
        self.panel.add_patch(Rectangle(corner, width, height, facecolor=FILL, edgecolor=BLACK))
        self.text(x, y, text)

    def sum(self, x: float, y: float, minus: Point | None = None) -> None:
        """A sum centred at (x, y), with a minus sign beside the wire from this direction."""
        from matplotlib.patches import Circle

        self.panel.add_patch(Circle((x, y), SUM_RADIUS, facecolor="white", edgecolor=BLACK))
        if minus is not None:
            away = 2.0 * SUM_RADIUS
            self.text(x + away * (minus[0] or 1), y + away * (minus[1] or 1), r"$-$")

    def branch(self, x: float, y: float) -> None:
        """A dot where one wire branches off another."""
        from matplotlib.patches import Circle

        self.panel.add_patch(Circle((x, y), DOT_RADIUS, color=BLACK))

    def wire(self, *points: Point, name: str = "", arrow: bool = True) -> None:
        """A wire through points, with the name of its signal above its longest horizontal part."""
        *before, last = points
        if arrow:
            look = {"arrowstyle": "-|>", "color": BLACK, "shrinkA": 0.0, "shrinkB": 0.0}
            self.panel.annotate("", last, before[-1], arrowprops=look)
        else:
            before = [*before, last]
        self.panel.plot(*zip(*before, strict=True), color=BLACK, linewidth=1.0)
        if name:
            level = [pair for pair in pairwise(points) if pair[0][1] == pair[1][1]]
            (a, height), (b, _) = max(level, key=lambda pair: abs(pair[0][0] - pair[1][0]))
            self.text((a + b) / 2, height + 0.08, name, "bottom")

    def text(self, x: float, y: float, words: str, vertical: str = "center") -> None:
        """Words centred at (x, y), or with their "bottom" at y."""
        self.panel.text(x, y, words, ha="center", va=vertical)


def loop_diagram(kind: DiagramKind) -> Figure:
    """The block diagram of a standard loop of robust control.

    Parameters
    ----------
    kind
        "N-Delta": a closed loop N and its uncertainty; "P-K": a generalised plant, its uncertainty
        and its controller; "two degrees of freedom": set-point and measurement enter the controller
        separately; "sampled": a sampled controller and a continuous plant; or "fault filter": a
        filter that estimates faults of a loop.

    Returns
    -------
    Figure
        A Matplotlib figure, which a notebook shows.

    Raises
    ------
    InputError
        Another kind.

    Examples
    --------
    >>> from workbench.figures import loop_diagram
    >>> figure = loop_diagram("P-K")
    >>> len(figure.axes)
    1
    """
    if kind not in _DRAWN:
        raise InputError(f"kind is {kind!r}; diagrams are {', '.join(map(repr, _DRAWN))}")
    return _DRAWN[kind]()


def plant_diagram(
    perturbation: bool,
    exogenous: Sequence[str],
    performance: Sequence[str],
    controls: Sequence[str],
    measurements: Sequence[str],
) -> Figure:
    """A generalised plant P with its perturbation and its controller K, with signal names."""
    drawn = BlockDiagram(8.0, 4.6 if perturbation else 3.4)
    middle, low = 4.0, 0.6
    centre = 2.3
    drawn.block(middle, centre, "$P$", width=2.0, height=1.6)
    drawn.wire((0.4, centre), (3.0, centre), name=_names_in_lines(exogenous))
    drawn.wire((5.0, centre), (7.6, centre), name=_names_in_lines(performance))
    if controls or measurements:
        drawn.block(middle, low, "$K$", height=0.8)
        down = centre - 0.5
        drawn.wire((5.0, down), (5.9, down), (5.9, low), (4.8, low))
        drawn.wire((3.2, low), (2.1, low), (2.1, down), (3.0, down))
        drawn.text(1.7, (low + down) / 2, "\n".join(_first_and_last(controls)))
        drawn.text(6.3, (low + down) / 2, "\n".join(_first_and_last(measurements)))
    if perturbation:
        high, up = 4.0, centre + 0.5
        drawn.block(middle, high, r"$\Delta$", height=0.8)
        drawn.wire((5.0, up), (5.9, up), (5.9, high), (4.8, high))
        drawn.wire((3.2, high), (2.1, high), (2.1, up), (3.0, up))
    return drawn.figure


def _names_in_lines(names: Sequence[str]) -> str:
    """Names above a wire, in two lines if they are long."""
    few = _first_and_last(names)
    half = (len(few) + 1) // 2
    text = ", ".join(few)
    if len(text) <= MOST_LETTERS or len(few) < 2:
        return text
    return ", ".join(few[:half]) + ",\n" + ", ".join(few[half:])


def _first_and_last(names: Sequence[str]) -> list[str]:
    """All names; or the first, dots, and the last."""
    return list(names) if len(names) <= MOST_NAMED else [names[0], "...", names[-1]]


def _n_delta() -> Figure:
    drawn = BlockDiagram(7.0, 3.2)
    drawn.block(3.5, 1.1, "$N$", width=2.0, height=1.4)
    drawn.block(3.5, 2.7, r"$\Delta$", height=0.8)
    drawn.wire((4.5, 1.4), (5.4, 1.4), (5.4, 2.7), (4.3, 2.7))
    drawn.wire((2.7, 2.7), (1.6, 2.7), (1.6, 1.4), (2.5, 1.4))
    drawn.wire((0.4, 0.8), (2.5, 0.8), name="$w$")
    drawn.wire((4.5, 0.8), (6.6, 0.8), name="$z$")
    drawn.text(5.75, 2.05, r"$z_\Delta$")
    drawn.text(1.25, 2.05, r"$w_\Delta$")
    return drawn.figure


def _p_k() -> Figure:
    return plant_diagram(True, ["$w$"], ["$z$"], ["$u$"], ["$y$"])


def _two_degrees_of_freedom() -> Figure:
    drawn = BlockDiagram(9.0, 3.0)
    drawn.block(2.4, 1.9, "$K$", height=1.4)
    drawn.block(6.0, 1.9, "$G$")
    drawn.sum(4.4, 1.9)
    drawn.sum(7.6, 1.9)
    drawn.wire((0.3, 2.2), (1.6, 2.2), name="$r$")
    drawn.wire((3.2, 1.9), (4.24, 1.9), name="$u$")
    drawn.wire((4.56, 1.9), (5.2, 1.9))
    drawn.wire((6.8, 1.9), (7.44, 1.9))
    drawn.wire((7.76, 1.9), (8.8, 1.9), name="$y$")
    drawn.wire((4.4, 2.9), (4.4, 2.06))
    drawn.wire((7.6, 2.9), (7.6, 2.06))
    drawn.text(4.75, 2.7, "$d_u$")
    drawn.text(7.95, 2.7, "$d_y$")
    drawn.branch(8.3, 1.9)
    drawn.wire((8.3, 1.9), (8.3, 0.5), (0.9, 0.5), (0.9, 1.6), (1.6, 1.6))
    return drawn.figure


def _sampled() -> Figure:
    drawn = BlockDiagram(11.6, 2.8)
    drawn.sum(1.2, 1.9, minus=(-1, -1))
    drawn.wire((0.2, 1.9), (1.04, 1.9), name="$r_k$")
    drawn.wire((1.36, 1.9), (2.2, 1.9), name="$e_k$")
    drawn.block(3.0, 1.9, "$K(z)$")
    drawn.wire((3.8, 1.9), (4.7, 1.9), name="$u_k$")
    drawn.block(5.5, 1.9, "delay\nand hold")
    drawn.wire((6.3, 1.9), (7.3, 1.9), name="$u(t)$")
    drawn.block(8.1, 1.9, "$G(s)$")
    drawn.wire((8.9, 1.9), (11.4, 1.9), name="$y(t)$")
    drawn.branch(9.6, 1.9)
    drawn.block(5.5, 0.6, "sampler", height=0.8)
    drawn.wire((9.6, 1.9), (9.6, 0.6), (6.3, 0.6))
    drawn.wire((4.7, 0.6), (1.2, 0.6), (1.2, 1.74), name="$y_k$")
    return drawn.figure


def _fault_filter() -> Figure:
    drawn = BlockDiagram(9.6, 3.0)
    drawn.block(3.0, 1.9, "closed\nloop", width=1.8, height=1.6)
    drawn.wire((0.6, 2.3), (2.1, 2.3), name="$d$")
    drawn.wire((0.6, 1.5), (2.1, 1.5), name="$f$")
    drawn.branch(1.0, 1.5)
    drawn.wire((3.9, 1.9), (5.4, 1.9), name="$y$")
    drawn.block(6.2, 1.9, "$F$")
    drawn.wire((7.0, 1.9), (8.04, 1.9), name="$u_f$")
    drawn.sum(8.2, 1.9, minus=(-1, 1))
    drawn.wire((8.36, 1.9), (9.4, 1.9), name="$f - u_f$")
    drawn.wire((1.0, 1.5), (1.0, 0.5), (8.2, 0.5), (8.2, 1.74))
    return drawn.figure


_DRAWN: dict[str, Callable[[], Figure]] = {
    "N-Delta": _n_delta,
    "P-K": _p_k,
    "two degrees of freedom": _two_degrees_of_freedom,
    "sampled": _sampled,
    "fault filter": _fault_filter,
}
