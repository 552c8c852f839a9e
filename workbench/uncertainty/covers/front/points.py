"""Certified covers of several orders: which are on the front, and which one is chosen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass, field
from itertools import cycle
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from workbench import figures
from workbench._core.heavy_types import Axes
from workbench.answer import Answer
from workbench.errors import InputError
from workbench.uncertainty.covers.cover import UncertaintyCover
from workbench.uncertainty.covers.limits.least_inflation import LeastInflation
from workbench.uncertainty.covers.model import UncertaintyModel
from workbench.uncertainty.covers.steps import CoverSteps

LEGEND = """\
inflation: largest ratio of a set's size to the narrowest one about the nominal
rms: the same ratio of root mean square radii; free: relative to sets with free centres"""
"""Lines below the table of a front, which say what its columns are."""
Orders = tuple[int, int, int]
"""Orders of the nominal, of W_c and of W_r; the last one is 0 for circles."""
MARKERS = ("o", "s", "+", "x", "^", "v")
"""Markers of the sizes in a figure."""
Loop = Callable[[UncertaintyModel], float]
"""Function of a model that returns a bound on mu of a loop, infinite for an unstable one."""


@dataclass(frozen=True)
class FrontCover:
    """One certified cover of a front.

    ``orders`` are those that were asked for. The functions of the cover may have less, see
    `cover_front`.
    ``inflation`` and ``rms`` compare its sets with the narrowest ones about its nominal,
    ``inflation_free`` and ``rms_free`` with those whose centres are free: the largest radius plus
    half-length, and the root mean square of the radius. ``mu`` is that of the loop, NaN without
    one. ``cost`` is what the front compares.
    """

    orders: Orders
    method: str
    cover: CoverSteps
    inflation: float
    inflation_free: float
    rms: float
    rms_free: float
    mu: float

    @classmethod
    def of_cover(
        cls,
        program: UncertaintyCover,
        orders: Orders,
        method: str,
        cover: CoverSteps,
        loop: Loop | None,
    ) -> FrontCover:
        """The point of a cover, with its sizes and mu of the loop computed."""
        over = program.inflation(cover)
        return cls(
            orders,
            method,
            cover,
            float(over.about.max()),
            float(over.free.max()),
            over.rms,
            over.rms_free,
            float("nan") if loop is None else _mu(loop, cover.model, orders),
        )

    @property
    def states(self) -> int:
        """Sum of the orders, which is the number of states of the uncertain plant."""
        return sum(self.orders)

    @property
    def cost(self) -> float:
        """Mu of the loop or, without a loop, the largest ratio to the narrowest sets."""
        if np.isnan(self.mu):
            return max(self.inflation, self.inflation_free, self.rms_free)
        return self.mu


@dataclass(frozen=True, eq=False, repr=False)
class CoverFront(Answer):
    """Certified covers of several orders, and the one that is chosen.

    ``points`` are by increasing number of states. ``failures`` are the reasons why there is no
    cover, by orders. ``least`` are lower bounds on ``inflation_free``, by order of the nominal: no
    nominal of this order allows less, whatever the weights. `cover_front` returns it.

    Examples
    --------
    >>> from workbench.uncertainty import CoverFront
    >>> CoverFront.choice(states=[2, 4, 6, 8], cost=[3.0, 1.05, 1.02, 1.0])
    1
    """

    near_best: ClassVar[float] = 0.1
    """The chosen cover costs at most this much more than the best one, relative. A tenth of the
    cost is 5 % of a size, which no controller notices. With half of it the chosen cover has more
    states; with double of it fewer.
    """

    points: tuple[FrontCover, ...]
    _: KW_ONLY
    failures: dict[Orders, str] = field(default_factory=dict, kw_only=True)
    least: dict[int, LeastInflation] = field(default_factory=dict, kw_only=True)

    @property
    def front(self) -> tuple[FrontCover, ...]:
        """The points that no other point beats: none has at most as many states and costs less."""
        kept: list[FrontCover] = []
        for point in self.points:  # of equally many states the cheapest comes first
            if not kept or point.cost < kept[-1].cost:
                kept.append(point)
        return tuple(kept)

    @property
    def dominated(self) -> tuple[FrontCover, ...]:
        """The points that are not on the front."""
        front = self.front
        return tuple(point for point in self.points if all(point is not one for one in front))

    @property
    def chosen(self) -> FrontCover:
        """The point with the fewest states whose cost is near the least one, by `near_best`."""
        points = self.points
        return points[self.choice([p.states for p in points], [p.cost for p in points])]

    @classmethod
    def choice(cls, states: ArrayLike, cost: ArrayLike) -> int:
        """Index of the fewest states (N,) whose cost (N,) is near the least one, by `near_best`."""
        states, cost = np.asarray(states), np.asarray(cost)
        near = cost <= cost.min() * (1 + cls.near_best)
        return int(np.lexsort((cost, np.where(near, states, np.inf)))[0])

    @classmethod
    def draw(
        cls,
        panel: Axes,
        states: ArrayLike,
        sizes: Mapping[str, ArrayLike],
        *,
        cost: ArrayLike | None = None,
    ) -> None:
        """Draw sizes of covers (N,), by their names, over the numbers of states (N,).

        With a ``cost`` (N,), its front is drawn too, and the cost up to which covers are near the
        best one, by `near_best`.

        Examples
        --------
        >>> from workbench import figures
        >>> from workbench.uncertainty import CoverFront
        >>> figure, (panel,) = figures.axes(1, 1)
        >>> CoverFront.draw(panel, [2, 4], {"extent": [1.5, 1.1]}, cost=[1.5, 1.1])
        >>> [line.get_label() for line in panel.lines]
        ['extent', 'front', '10% above the best']
        """
        from matplotlib.ticker import MaxNLocator

        states = np.asarray(states)
        for (name, values), marker in zip(sizes.items(), cycle(MARKERS), strict=False):
            panel.plot(states, values, marker, label=name)
        if cost is not None:
            order = np.argsort(states, kind="stable")
            best = np.minimum.accumulate(np.asarray(cost)[order])
            panel.step(states[order], best, where="post", color="0.6", label="front")
            near = f"{cls.near_best:.0%} above the best"
            panel.axhline(best[-1] * (1 + cls.near_best), color="0.4", linewidth=0.8, label=near)
        figures.label(panel, x="states of $G$, $W_c$ and $W_r$")
        panel.xaxis.set_major_locator(MaxNLocator(integer=True))
        panel.legend(fontsize=7)

    @property
    def value(self) -> float:
        """Cost of the chosen point."""
        return self.chosen.cost

    def summary(self) -> str:
        heads = "states  orders (G, W_c, W_r)  inflation  free   least  rms    rms free  mu"
        front, least = self.front, self.least
        rows = [
            f"{p.states:6d}  {p.orders!s:21s} {p.inflation:9.3f}  {p.inflation_free:5.3f}  "
            + (f"{least[p.orders[0]].value:5.3f}  " if p.orders[0] in least else "-      ")
            + f"{p.rms:5.3f}  {p.rms_free:5.3f}     {'-' if np.isnan(p.mu) else f'{p.mu:.3f}'}"
            + (" *" if p is self.chosen else "" if p in front else "  (dominated)")
            for p in self.points
        ]
        missing = [f"  {orders}: {why}" for orders, why in self.failures.items()]
        return "\n".join(["CoverFront (* chosen)", heads, *rows, *missing, LEGEND])


def _mu(loop: Loop, model: UncertaintyModel, orders: Orders) -> float:
    """What the user's function returns for a model, or an `InputError`."""
    try:
        given: Any = loop(model)
    except Exception as error:
        raise InputError(
            f"loop raised {type(error).__name__} for the cover of orders {orders}: {error}"
        ) from error
    if not isinstance(given, float | int | np.number) or not given >= 0:
        raise InputError(
            f"loop must return mu, a number of 0 or more (inf if the loop is unstable); for the "
            f"cover of orders {orders} it returned {given!r}"
        )
    return float(given)
