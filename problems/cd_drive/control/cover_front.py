"""Order of stadium covers against their size and against mu of the reference controller.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from workbench import Run, figures, problem, ref
from workbench.certificate import EVERY_PERTURBATION
from workbench.executor import Context
from workbench.mu import performance_peak
from workbench.study import Study, array, check, dim, figure, metric, table
from workbench.types import DataArray, Figure, RealArray
from workbench.uncertainty import CoverFront, UncertaintyModel, cover_sets

from ..drive.plants import controller
from ..drive.shared_parameters import TABLES, Frequencies
from ..drive.tables import Axis
from .control_problem import generalised
from .design import uncertainty
from .loop_weights import CHANNELS, channel_of

ORDERS = ((2, 2, 2), (4, 4, 4), (4, 6, 6), (4, 6, 8), (6, 6, 6), (6, 6, 8), (8, 8, 8), (12, 12, 12))
"""Orders of nominal, W_c and W_r."""
EXCESS = 2
"""Number of poles of the nominal less that of its zeros, as of the drives."""
RATIOS = {
    "inflation": "extent, about the nominal",
    "inflation_free": "extent, free centres",
    "width_rms_inflation": "rms width, about the nominal",
    "width_rms_inflation_free": "rms width, free centres",
}
"""Metrics of a cover that compare its sets with the narrowest ones."""
CHANNEL = "disturbance"
PEAK_TOLERANCE = 1e-3
"""Relative width of the interval that certifies a peak."""


def needs(
    axis: str, frequencies: int = 400, cover: Literal["joint", "inflation"] = "inflation", **_: Any
) -> dict[str, Any]:
    """References to the stadiums of all orders."""
    name = f"cd/{axis}/stadium-cover"
    return {
        "covers": [
            ref(
                name,
                method=cover,
                frequencies=frequencies,
                order=order,
                zeros=max(order - EXCESS, 0),
                complex_order=circle,
                real_order=real,
            )
            for order, circle, real in ORDERS
        ]
    }


@dataclass(frozen=True, eq=False)
class CoverFrontOfAxis(Study):
    """Sizes of the covers, and mu of the reference controller's loop with each of them."""

    axis: Axis
    covers: list[Run]

    headline: ClassVar[str] = "chosen_states"

    @property
    def quantifier(self) -> str:
        return EVERY_PERTURBATION

    cover = dim(lambda: [", ".join(map(str, orders)) for orders in ORDERS], meaning="orders")
    bound, ratio = dim("lower", "upper"), dim(RATIOS)
    states = array(
        dims=(cover,), unit="1", meaning="sum of the orders", value=lambda: np.sum(ORDERS, axis=1)
    )

    @array(dims=(cover, ratio), unit="1", meaning="size over that of the narrowest sets")
    def over_narrowest(self) -> list[list[float]]:
        return [[run.metrics[name] for name in RATIOS] for run in self.covers]

    @array(dims=(cover, bound), unit="1", meaning="certified bounds of the peak of mu, w_p to z_p")
    def peak(self, context: Context) -> RealArray:
        """Infinite if the nominal loop is unstable."""
        exogenous, performance = CHANNELS[CHANNEL]
        K, found = controller(self.axis), []
        for run in context.track(self.covers, "peaks"):
            plant = generalised(self.axis, uncertainty(self.axis, run)).channel(
                performance=performance, exogenous=exogenous
            )
            one = performance_peak(plant, K, tolerance=PEAK_TOLERANCE)
            found.append([np.inf] * 2 if one is None else [one.lower, one.upper])
        return np.array(found)

    @array(dims=(cover,), unit="1", meaning="largest mu of the narrowest sets about the nominal")
    def peak_of_sets(self) -> list[float]:
        found = []
        for run in self.covers:
            model, omega = uncertainty(self.axis, run), 2 * np.pi * run.data["frequency"].values
            assert isinstance(model, UncertaintyModel)
            loop = channel_of(self.axis, model.nominal, controller(self.axis), CHANNEL, 1.0, omega)
            found.append(float(loop.mu(cover_sets(run.data, "second")).max()))
        return found

    @check(title="peaks", statement="lower over upper bound of a peak", at_most=1.0)
    def peaks_in_order(peak: DataArray) -> DataArray:  # noqa: N805
        lower, upper = peak.sel(bound="lower"), peak.sel(bound="upper")
        return (lower / upper).where(lower != upper, 1.0)  # both are infinite for unstable loops

    @metric
    def chosen(
        self, states: DataArray, over_narrowest: DataArray, peak: DataArray
    ) -> dict[str, float]:
        """The covers with the fewest states within 10 % of the least size, and of the least mu."""
        costs = _largest(over_narrowest), peak.sel(bound="upper").values
        found = {}
        for name, cost in zip(("chosen", "chosen_for_mu"), costs, strict=True):
            k = CoverFront.choice(states.values, cost)
            found[f"{name}_states"] = float(states[k])
            parts = zip(("nominal", "Wc", "Wr"), ORDERS[k], strict=True)
            found |= {f"{name}_order_{part}": float(order) for part, order in parts}
        return found

    @table
    def costs(
        self, over_narrowest: DataArray, peak: DataArray, peak_of_sets: DataArray
    ) -> tuple[list[str], list[list[str]]]:
        rows = []
        for orders in over_narrowest["cover"].values:
            sizes = [f"{v:.3f}" for v in over_narrowest.sel(cover=orders).values]
            low, high = peak.sel(cover=orders).values
            alone = f"{float(peak_of_sets.sel(cover=orders)):.3f}"
            rows.append([str(orders), *sizes, f"{low:.3f} to {high:.3f}", alone])
        return ["orders of G, W_c, W_r", *RATIOS.values(), "peak of mu", "mu of the sets"], rows

    @figure
    def front(
        self, states: DataArray, over_narrowest: DataArray, peak: DataArray, peak_of_sets: DataArray
    ) -> Figure:
        """Sizes and peaks of mu over the number of states."""
        drawn, (left, right) = figures.axes(1, 2, size=(10.0, 4.4))
        sizes = {label: over_narrowest.sel(ratio=name) for name, label in RATIOS.items()}
        CoverFront.draw(left, states, sizes, cost=_largest(over_narrowest))
        mu = {"fitted stadiums": peak.sel(bound="upper"), "narrowest sets alone": peak_of_sets}
        CoverFront.draw(right, states, mu)
        size = "size over that of the narrowest sets"
        figures.label(left, y=size, title=self.axis, log="y")
        figures.label(right, y="peak of $\\mu$, $w_p$ to $z_p$")
        return drawn


def _largest(over_narrowest: DataArray) -> RealArray:
    """Largest ratio of each cover that no choice of the nominal alone makes small."""
    kept = [name for name in RATIOS if name != "width_rms_inflation"]
    return np.asarray(over_narrowest.sel(ratio=kept).max("ratio").values)


@problem("cd/{axis}/cover-front", slow=True, axis=("focus", "radial"), needs=needs, data=TABLES)
def cover_front(
    axis: Axis,
    covers: list[Run],
    frequencies: Frequencies = 400,
    cover: Literal["joint", "inflation"] = "inflation",
) -> CoverFrontOfAxis:
    """Stadium covers of several orders: their size, and mu of the reference controller (5.4).

    The size of a cover is compared with that of the narrowest stadiums, about its nominal and with
    free centres. The chosen cover has the fewest states within 10 % of the smallest one.

    frequencies: number of frequencies of the covers. cover: method of the covers.
    """
    return CoverFrontOfAxis(axis, covers)
