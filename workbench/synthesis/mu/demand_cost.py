"""The price in mu of demands on the controller: low order, own stability, slow poles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any, ClassVar

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import DataArray, Dataset, Figure, StateSpace
from workbench.certificate import EVERY_PERTURBATION, Check
from workbench.errors import InputError
from workbench.executor import Context
from workbench.executor.effort import deeper
from workbench.input_checks import as_list, need_positive
from workbench.second_opinion import loops
from workbench.solution import solve
from workbench.study import Study, array, check, dim, figure, metric, part
from workbench.synthesis.families.demands import Shippable
from workbench.synthesis.mu.mu_controller import MuController
from workbench.synthesis.mu.program import MuSynthesis
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import realisation

PEAK_SLACK = 1e-3
"""Relative excess allowed of a recomputed peak over the stored one."""

LOOKS = ("o-", "s--", "^:")
"""Line styles for the curves of the demands, which often coincide."""


@dataclass(frozen=True, eq=False)
class DemandCost(Study):
    """Certified peaks of mu for controllers with demands, and for one without demands.

    For each order, method "fixed" searches for a controller without further demands, for one that
    is itself stable and, if a fastest pole is given, for a stable one with no faster pole. It finds
    local optima, so a controller found for one demand is also used for every other demand that it
    meets.

    Parameters
    ----------
    plant
        Generalised plant as in `MuSynthesis`.
    orders
        Numbers of states of the controllers.
    fastest_pole
        Largest size of a pole [rad/s]; None to demand stability only.
    method
        Method for the controller without demands.

    Raises
    ------
    InputError
        As in `MuSynthesis`; or `orders` is empty.

    Examples
    --------
    >>> import control
    >>> from workbench.structure import Complex
    >>> from workbench.synthesis import DemandCost
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.ss([], [], [], [[0.2]]), "u", "z"),
    ...     (control.tf([0.4], [1.0, 0.01]), "e", "z_e"),
    ... ]
    >>> sums = {"v": "u + d", "e": "r - y"}
    >>> uncertain = [(Complex(1), "z", "d")]
    >>> plant = generalised_plant(
    ...     parts,
    ...     sums,
    ...     perturbation=uncertain,
    ...     exogenous=["r"],
    ...     performance=["z_e"],
    ...     control=["u"],
    ...     measurement="e",
    ... )
    >>> K = control.ss([[-0.01]], [[1.0]], [[1.0]], [[1.0]])
    >>> study = DemandCost(plant, orders=(1, 2), fastest_pole=100.0)
    >>> len(study.demands)
    3
    """

    plant: GeneralisedPlant
    _: KW_ONLY
    orders: tuple[int, ...] = (1, 2, 4)
    fastest_pole: float | None = None
    method: str = "dk"

    headline: ClassVar[str] = "least_peak"

    def __post_init__(self) -> None:
        need_positive(self.fastest_pole, "fastest_pole", or_none=True)
        orders = tuple(as_list(self.orders, "orders"))
        if not orders:
            raise InputError("orders is empty; give at least one number of states")
        for order in orders:
            MuSynthesis(self.plant, order=order)  # raises InputError for demands that do not fit
        object.__setattr__(self, "orders", tuple(sorted(set(orders))))

    @property
    def quantifier(self) -> str:
        return EVERY_PERTURBATION

    @property
    def demands(self) -> dict[str, dict[str, Any]]:
        """The demands, by their words."""
        found: dict[str, dict[str, Any]] = {"order alone": {}, "stable": {"stable": True}}
        if self.fastest_pole is not None:
            words = f"stable, poles up to {self.fastest_pole:g} rad/s"
            found[words] = {"stable": True, "fastest_pole": self.fastest_pole}
        return found

    demand = dim(lambda self: list(self.demands), meaning="what is asked of the controller")
    order = dim(lambda self: list(self.orders), meaning="states of the controller at most")
    bound = dim("lower", "upper")
    row = dim(lambda self: np.arange(self.orders[-1] + self.plant.controls))
    column = dim(lambda self: np.arange(self.orders[-1] + self.plant.measurements))

    @part
    def designs(self, context: Context) -> dict[tuple[str, int], MuController | None]:
        """The controller for every demand and order; None where none was found."""
        cases = [(words, order) for words in self.demands for order in self.orders]
        answers: list[MuController] = []
        for words, order in context.track(cases, "demands"):
            program = MuSynthesis(self.plant, order=order, **self.demands[words])
            done = solve(program, method="fixed", context=Context(options=context.options))
            valid = done.certificate is not None and done.certificate.valid and done.proof is None
            answers += [done.answer] * valid
        answers.sort(key=lambda one: one.upper)
        return {
            (words, order): next(
                (one for one in answers if self._demands_of(words, order).admits(one.K)), None
            )
            for words, order in cases
        }

    def _demands_of(self, words: str, order: int) -> Shippable:
        """The demands on a controller, from words and order."""
        asked = self.demands[words]
        return Shippable(order, asked.get("stable", False), asked.get("fastest_pole"))

    @array(
        dims=(demand, order, bound),
        unit="1",
        meaning="certified bounds of the peak of mu, infinite: none found",
    )
    def peak(self, designs: Any) -> list[list[list[float]]]:
        return [[_bounds(designs[words, order]) for order in self.orders] for words in self.demands]

    @array(
        dims=(demand, order, row, column),
        unit="1",
        meaning="[A B; C D] of the controllers, NaN beyond",
    )
    def controllers(self, designs: Any) -> RealArray:
        size = self.orders[-1]
        shape = (size + self.plant.controls, size + self.plant.measurements)
        found = np.full((len(self.demands), len(self.orders), *shape), np.nan)
        for i, words in enumerate(self.demands):
            for j, order in enumerate(self.orders):
                one = designs[words, order]
                if one is not None:
                    K = one.K
                    M = np.block([[K.A, K.B], [K.C, K.D]])
                    found[i, j, : M.shape[0], : M.shape[1]] = M
        return found

    @array(
        dims=(bound,),
        unit="1",
        meaning="certified bounds of the peak without any demand, infinite: none found",
    )
    def free(self, context: Context) -> list[float]:
        done = solve(
            MuSynthesis(self.plant), method=self.method, context=Context(options=context.options)
        )
        valid = done.certificate is not None and done.certificate.valid
        return _bounds(done.answer if valid else None)

    @check(
        title="peaks",
        statement="peak proven again over the stored one, less 1",
        at_most=PEAK_SLACK,
        where="{demand}, order {order}",
    )
    def proven(self, peak: DataArray, controllers: DataArray) -> DataArray:
        upper = peak.sel(bound="upper")
        excess = np.zeros(upper.shape)
        for place in np.argwhere(np.isfinite(upper.values)):
            again = MuSynthesis(self.plant).certified_peak(
                self._stored_controller(controllers, *place)
            )
            value = math.inf if again is None else again.upper
            excess[tuple(place)] = value / float(upper.values[tuple(place)]) - 1
        return upper.copy(data=excess)

    @check(
        title="demands",
        statement="largest number of demands that a controller does not meet",
        at_most=0.0,
        where="{demand}, order {order}",
    )
    def met(self, peak: DataArray, controllers: DataArray) -> DataArray:
        upper = peak.sel(bound="upper")
        missed = np.zeros(upper.shape)
        for i, j in np.argwhere(np.isfinite(upper.values)):
            demands = self._demands_of(list(self.demands)[i], self.orders[j])
            K = self._stored_controller(controllers, i, j)
            missed[i, j] = sum(not one.holds for one in demands.checks(K))
        return upper.copy(data=missed)

    def deep_opinion(self, answer: Dataset) -> Sequence[Check]:
        """Try each loop by powers of its transition matrix, and with plants of its set."""
        upper, found = answer["peak"].sel(bound="upper").values, []
        program = MuSynthesis(self.plant)
        with deeper():
            for i, j in np.argwhere(np.isfinite(upper)).tolist():
                K, where = self._stored_controller(answer["controllers"], i, j), self._words(i, j)
                loop = self.plant.close(K)
                claim = program.structure, (1 + PEAK_SLACK) * float(upper[i, j])
                tried = [
                    loops.powers_fall(loop.A, loop.dt),
                    loops.gain(self.plant.system, K, *claim, poles=loop.poles()),
                    *loops.in_time(loop, *claim),
                ]
                found += [replace(check, name=f"{where}: {check.name}") for check in tried]
        return [*super().deep_opinion(answer), *found]

    def _words(self, i: int, j: int) -> str:
        """A demand and an order in words."""
        return f"{list(self.demands)[i]}, order {self.orders[j]}"

    def _stored_controller(self, controllers: DataArray, i: int, j: int) -> StateSpace:
        """The stored controller of a demand and an order, by their indices."""
        whole = controllers.values[i, j]
        rows, columns = (int(np.isfinite(part).sum()) for part in (whole[:, 0], whole[0]))
        M, n = whole[:rows, :columns], rows - self.plant.controls
        return realisation((M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]), 0.0)

    least_peak = metric(lambda peak: peak.sel(bound="upper").min())
    free_peak = metric(lambda free: free.sel(bound="upper"))

    @figure
    def cost(self, peak: DataArray, free: DataArray) -> dict[str, Figure]:
        drawn, (panel,) = figures.axes(1, 1, size=(7.2, 4.6))
        for words, look in zip(peak["demand"].values, LOOKS, strict=False):
            upper = peak.sel(bound="upper", demand=words)
            panel.plot(peak["order"], upper.where(np.isfinite(upper)), look, label=str(words))
        level = float(free.sel(bound="upper"))
        if math.isfinite(level):
            words = f"no demand ({self.method})"
            panel.axhline(level, color=figures.BLACK, linestyle="--", label=words)
        panel.set_xticks(list(self.orders))
        figures.label(panel, x="order of the controller", y=r"certified peak of $\mu$")
        figures.legend_below(drawn, panel, columns=2)
        return {"cost": drawn}


def _bounds(answer: MuController | None) -> list[float]:
    """Lower and upper bound on a peak; infinite without an answer."""
    return [math.inf, math.inf] if answer is None else [answer.lower, answer.upper]
