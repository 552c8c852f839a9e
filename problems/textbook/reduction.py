"""How low the order of a benchmark's robust controller can go."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from workbench import Check, Run, Study, figures, problem, ref
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure
from workbench.program import worst
from workbench.synthesis import MuSynthesis, reduce_order
from workbench.systems.storage import restored, stored
from workbench.uncertainty import GeneralisedPlant

from .controller import PLANTS

TOLERANCE = 1e-3
"""Of certified peaks, relative."""


def needs(plant: str, after: str = "mu-dk", **_: Any) -> dict[str, Any]:
    """The controller of full order."""
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

    Weighted balanced reduction of the full controller; what then exceeds the target is refined by
    nonsmooth optimisation of the peak. Each loop's stability and peak are certified anew.

    after: the method whose controller is reduced. target: the largest peak accepted.
    """
    return ReductionCurve(plant, PLANTS[plant](), full, target)


@dataclass(frozen=True, eq=False)
class ReductionCurve(Study):
    """Certified peaks of every order, reduced alone and refined."""

    name: str
    plant: GeneralisedPlant
    full: Run
    target: float

    headline: ClassVar[str] = "least_order"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        K = restored(self.full.data, "controller")
        plain = reduce_order(K, self.plant, target=self.target)
        refined = reduce_order(K, self.plant, target=self.target, refine=True, context=context)
        curves = {each.order: [each.lower, each.upper] for each in plain.tried}
        orders = [each.order for each in refined.tried]
        unit = {"units": "1"}
        least: dict[str, Any] = {}
        if refined.smallest is not None:
            least = stored("controller", refined.smallest.K)
        return xr.Dataset(
            {
                "peak": (
                    ("refined", "order", "bound"),
                    [
                        [curves[order] for order in orders],
                        [[each.lower, each.upper] for each in refined.tried],
                    ],
                    unit | {"long_name": "certified bounds of the peak, infinite: unstable"},
                ),
                **least,
            },
            coords={
                "refined": ["reduced", "refined"],
                "order": ("order", orders, {"long_name": "states of the controller"}),
                "bound": ["lower", "upper"],
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        upper = answer["peak"].sel(bound="upper")
        gain = upper.sel(refined="refined") / upper.sel(refined="reduced")
        grown, where = worst(
            gain.where(np.isfinite(upper.sel(refined="reduced")), 0.0).values - 1,
            lambda k: f"order {int(answer['order'][k[0]])}",
        )
        statement = "refined over reduced peak, less 1"
        checks = [Check("refined", statement, grown, TOLERANCE, where)]
        if "controller_A" in answer:
            found = MuSynthesis(self.plant).certified(restored(answer, "controller"))
            peak = np.inf if found is None else found.upper
            statement = "certified peak of the smallest controller"
            checks.append(Check("target", statement, peak, self.target * (1 + TOLERANCE)))
        return checks

    def metrics(self, answer: Dataset) -> dict[str, float]:
        upper = answer["peak"].sel(bound="upper")
        found = {"order_full": float(answer["order"].max())}
        for name, key in (("reduced", "least_order_reduced"), ("refined", "least_order")):
            orders = answer["order"].values[upper.sel(refined=name).values <= self.target]
            found[key] = float(orders.min()) if orders.size else np.nan
        found["peak"] = float(upper.min())
        return found

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        figure, (panel,) = figures.axes(size=(7.2, 4.6))
        upper = answer["peak"].sel(bound="upper")
        for name, look in (("reduced", "o:"), ("refined", "s-")):
            curve = upper.sel(refined=name)
            panel.semilogy(answer["order"], curve.where(np.isfinite(curve)), look, label=name)
        panel.axhline(self.target, color="0.4", linewidth=0.8)
        panel.set_xlabel("order of the controller")
        panel.set_ylabel("certified peak of mu")
        panel.set_title(f"{self.name}: what the order costs")
        top = upper.sel(refined="refined")
        finite = top.values[np.isfinite(top.values)]
        panel.set_ylim(0.95 * float(upper.min()), min(10.0, 1.2 * float(finite.max())))
        figures.legend_below(figure, panel)
        return {"order": figure}
