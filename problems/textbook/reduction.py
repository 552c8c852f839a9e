"""How low the order of a benchmark's robust controller can go."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from workbench import Run, figures, problem, ref
from workbench.certificate import EVERY_PERTURBATION
from workbench.executor import Context
from workbench.study import Study, array, check, dim, figure, metric, part, system
from workbench.synthesis import MuSynthesis, reduce_order
from workbench.types import DataArray, Figure, StateSpace
from workbench.uncertainty import GeneralisedPlant

from .controller import PLANTS

PEAK_SLACK = 1e-3
"""Largest accepted relative excess of a certified peak over its limit."""


def needs(plant: str, after: str = "mu-dk", **_: Any) -> dict[str, Any]:
    """Reference to the controller of full order."""
    return {"full": ref(f"{plant}/controller", method=after)}


@problem(
    "{plant}/reduction",
    plant=("mass-spring", "distillation", "unstable-first-order"),
    needs=needs,
    slow=True,
)
def reduction(
    plant: Literal["mass-spring", "distillation", "unstable-first-order"],
    full: Run,
    after: Literal["dk", "mu-dk", "dgk"] = "mu-dk",
    target: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = 1.0,
) -> ReductionCurve:
    """The certified peak of mu against the controller's order, and the least order below a target.

    The full controller is reduced by weighted balanced reduction. Reduced controllers that exceed
    the target are refined by nonsmooth optimisation of the peak. Stability and peak of each loop
    are certified anew.

    after: method whose controller is reduced. target: largest accepted peak.
    """
    return ReductionCurve(plant, PLANTS[plant](), full, target)


HIGHEST_SHOWN = 10.0
"""Orders with a larger certified peak are left out of the figure."""
HIGHEST_RATIO = 1.5
"""Reduced controllers whose peak exceeds the highest refined peak by this factor are left out of
the figure.
"""


@dataclass(frozen=True, eq=False)
class ReductionCurve(Study):
    """Certified peaks of every order, with and without refinement."""

    name: str
    plant: GeneralisedPlant
    full: Run
    target: float

    headline: ClassVar[str] = "least_order"

    @property
    def quantifier(self) -> str:
        return EVERY_PERTURBATION

    @part
    def plain(self) -> Any:
        """Controllers of every order from balanced reduction alone."""
        return reduce_order(self.plant, self.full.answer.K, target=self.target)

    @part
    def best(self, context: Context) -> Any:
        """Controllers of every order, refined if the reduced one exceeds the target."""
        K = self.full.answer.K
        return reduce_order(self.plant, K, target=self.target, refine=True, context=context)

    refined, bound = dim("reduced", "refined"), dim("lower", "upper")
    order = dim(
        lambda best: [each.order for each in best.tried], meaning="states of the controller"
    )

    @array(
        dims=(refined, order, bound),
        unit="1",
        meaning="certified bounds of the peak, infinite: unstable",
    )
    def peak(self, plain: Any, best: Any) -> list[list[list[float]]]:
        curves = {each.order: [each.lower, each.upper] for each in plain.tried}
        return [
            [curves[each.order] for each in best.tried],
            [[each.lower, each.upper] for each in best.tried],
        ]

    @system
    def controller(self, best: Any) -> StateSpace | None:
        """The controller of the least order that meets the target; None if there is none."""
        return None if best.smallest is None else best.smallest.K

    @check(
        title="refined",
        statement="refined over reduced peak, less 1",
        at_most=PEAK_SLACK,
        where="order {order}",
    )
    def not_worse(self, peak: DataArray) -> DataArray:
        upper = peak.sel(bound="upper")
        reduced = upper.sel(refined="reduced")
        return (upper.sel(refined="refined") / reduced).where(np.isfinite(reduced), 0.0) - 1

    @check(
        title="target",
        statement="certified peak of the smallest controller",
        at_most=lambda self: self.target * (1 + PEAK_SLACK),
    )
    def reached(self, controller: StateSpace | None) -> float | None:
        if controller is None:
            return None
        found = MuSynthesis(self.plant).certified_peak(controller)
        return np.inf if found is None else found.upper

    order_full = metric(lambda order: order.max())
    least_order_reduced = metric(lambda self, peak: self.least_order(peak, "reduced"))
    refined_order = metric(
        template="least_order", value=lambda self, peak: self.least_order(peak, "refined")
    )
    peak_ = metric("peak", value=lambda peak: peak.sel(bound="upper").min())

    def least_order(self, peak: DataArray, refined: str) -> float:
        """The least order whose certified peak is at most the target; NaN where none is."""
        upper = peak.sel(bound="upper", refined=refined)
        orders = upper["order"].values[upper.values <= self.target]
        return float(orders.min()) if orders.size else np.nan

    @figure
    def orders(self, peak: DataArray) -> dict[str, Figure]:
        figure, (panel,) = figures.axes(1, 1, size=(7.2, 4.6))
        upper = peak.sel(bound="upper")
        for name, look in (("reduced", "o:"), ("refined", "s-")):
            curve = upper.sel(refined=name)
            panel.plot(peak["order"], curve.where(np.isfinite(curve)), look, label=name)
        panel.axhline(self.target, color="0.4", linewidth=0.8)
        title = f"{self.name}: what the order costs"
        figures.label(
            panel, x="order of the controller", y=r"certified peak of $\mu$", title=title, log="y"
        )
        values = upper.values[upper.values <= HIGHEST_SHOWN]
        refined = upper.sel(refined="refined").values
        most = HIGHEST_RATIO * refined.max(where=refined <= HIGHEST_SHOWN, initial=self.target)
        panel.set_ylim(0.95 * values.min(), 1.1 * values.max(where=values <= most, initial=0.0))
        figures.legend_below(figure, panel)
        return {"order": figure}
