"""Checks and figures of a front of covers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench import figures
from workbench._core.heavy_types import Figure
from workbench.certificate import Check, Checker, relative_excess
from workbench.uncertainty.covers.cover import UncertaintyCover
from workbench.uncertainty.covers.front.points import CoverFront, FrontCover, Loop, Orders
from workbench.uncertainty.covers.limits.least_inflation import (
    LeastInflation,
    LeastInflationChecker,
)

SIZES = {
    "inflation": "extent, about the nominal",
    "inflation_free": "extent, free centres",
    "rms": "rms of the radius, about the nominal",
    "rms_free": "rms of the radius, free centres",
}
"""Sizes of a cover that the figure shows."""
REPEATED = 1e-6
"""Relative rounding error by which a stated cost may be below the recomputed one. A cost is a mean
of squares, with twelve digits, and weights of high order lose some. With half of it a true front
may be refused on another processor; double overlooks 2e-6.
"""


@dataclass(frozen=True, eq=False)
class CoverFrontChecker(Checker):
    """Checks every cover of a front by the program of its orders, and recomputes its cost."""

    programs: dict[Orders, UncertaintyCover]
    loop: Loop | None

    @property
    def quantifier(self) -> str:
        return "for every cover of the front"

    def checks(self, answer: CoverFront, tolerance: float) -> list[Check]:
        found = []
        for point in answer.points:
            program = self.programs[point.orders]
            found += _named(point, program.checks(point.cover, tolerance))
            again = FrontCover.of_cover(program, point.orders, point.method, point.cover, self.loop)
            excess = relative_excess(again.cost, point.cost)
            statement = "recomputed cost over the told one, less 1"
            found += _named(point, [Check("cost", statement, excess, REPEATED)])
            if point.orders[0] in answer.least:
                least = answer.least[point.orders[0]].value
                statement = "its bound over the inflation with free centres, less 1"
                excess = relative_excess(least, again.inflation_free)
                found += _named(point, [Check("above the bound", statement, excess, REPEATED)])
        return found + [
            check
            for checker, least in self._limits(answer)
            for check in checker.checks(least, tolerance)
        ]

    def second_opinion(self, answer: CoverFront) -> list[Check]:
        return [
            check
            for point in answer.points
            for check in _named(point, self.programs[point.orders].second_opinion(point.cover))
        ] + [
            check
            for checker, least in self._limits(answer)
            for check in checker.second_opinion(least)
        ]

    def _limits(self, answer: CoverFront) -> list[tuple[LeastInflationChecker, LeastInflation]]:
        """The bounds of the nominals' orders, each with its checker."""
        programs = {orders[0]: program for orders, program in self.programs.items()}
        return [(LeastInflationChecker(programs[n]), least) for n, least in answer.least.items()]

    def figures(self, answer: CoverFront) -> dict[str, Figure]:
        return {"front": front_figure(answer)}


def _named(point: FrontCover, checks: Sequence[Check]) -> list[Check]:
    """Checks whose names begin with the orders of the point."""
    orders = ", ".join(map(str, point.orders))
    return [replace(check, name=f"{orders}: {check.name}") for check in checks]


def front_figure(answer: CoverFront) -> Figure:
    """Sizes and cost of the covers over their number of states."""
    figure, (left, right) = figures.axes(1, 2, size=(9.0, 4.0))
    states = [point.states for point in answer.points]
    sizes = {
        label: [getattr(point, name) for point in answer.points] for name, label in SIZES.items()
    }
    bounded = [point for point in answer.points if point.orders[0] in answer.least]
    least = [answer.least[point.orders[0]].value for point in bounded]
    left.plot([point.states for point in bounded], least, "_", color="0.4", markersize=12,
              label="extent, free centres, proven least")  # fmt: skip
    answer.draw(left, states, sizes)
    cost = [point.cost for point in answer.points]
    answer.draw(right, states, {"covers": cost}, cost=cost)
    chosen = answer.chosen
    right.plot(
        chosen.states, chosen.cost, "o", color=figures.ORANGE, label=f"chosen, {chosen.orders}"
    )
    right.legend(fontsize=7)
    figures.label(left, y="size over that of the narrowest sets")
    figures.label(right, y="largest ratio" if np.isnan(chosen.mu) else "mu of the loop")
    return figure
