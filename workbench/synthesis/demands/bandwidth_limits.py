"""Certified peak of mu for each structure of controller and bandwidth, and the limit of the
bandwidth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import DataArray, Dataset, Figure, StateSpace
from workbench.certificate import Check
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.executor import Context
from workbench.input_checks import need_kind, need_positive, need_whole
from workbench.solution import solve
from workbench.solvers import Options
from workbench.study import Study, array, dim, figure, metric, part, system, table
from workbench.synthesis.demands.demands import Demands, strictest
from workbench.synthesis.demands.relaxations import LARGEST_CHANGE, LimitedBandwidth, relaxations
from workbench.synthesis.demands.weighted_loop import demanded_plant, lateness
from workbench.synthesis.families.three_terms import PI, PID
from workbench.synthesis.mu.program import MuSynthesis
from workbench.systems.generalised_plant import GeneralisedPlant, response
from workbench.uncertainty import UncertaintyModel

STEPS = (-3, -2, -1, 0, 1, 2)
"""Powers of sqrt(2) that multiply the demanded bandwidth: these bandwidths are tried."""
HOPELESS = 1.5
"""After a peak of mu above this, no higher bandwidth is tried."""
CLEAR = 1.05
"""Least growth of the bandwidth for which a part counts as its limit."""
FREQUENCIES, PHASES = 1000, 16
"""Numbers of frequencies, and of phases of the plants' deviations, in the second opinion."""
PEAK_ROUNDING = 1e-3
"""Relative excess allowed of a sampled mu over a certified peak."""


@dataclass(frozen=True, eq=False)
class BandwidthLimits(Study):
    """The bandwidth up to which each structure and order meets the demands, and what limits it.

    PI, PID, controllers with few states and one of full order are designed for bandwidths around
    the demanded one, all with integral action. Each has its certified peak of mu. The limit of the
    bandwidth is computed: delay, spread of the plants, noise, limit of the control or zero right of
    the axis is left out in turn, and the largest bandwidth that any controller could have grows by
    a factor.

    Parameters
    ----------
    model
        Uncertainty model; continuous and multiplicative.
    demands
        Demands, including a bandwidth.
    dt, delay_samples
        Sampling time [s] of the controller, and computation delay [samples].
    states
        Largest order tried between PID and full order.
    noise_free
        The model without the noise of the records; None if it is not known.
    time_limit
        Time limit [s] for each controller; None for no limit.

    Raises
    ------
    InputError
        The model is additive or sampled, or no bandwidth is demanded; or as `demanded_plant`.

    Examples
    --------
    `workbench.solve` designs controllers of each structure for several bandwidths, which takes half
    a minute here.

    >>> import control
    >>> from workbench.synthesis import BandwidthLimits, Demands
    >>> from workbench.uncertainty import UncertaintyModel
    >>> model = UncertaintyModel(control.tf([2.0], [10.0, 1.0]), control.tf([0.1], [1.0]))
    >>> demands = Demands(bandwidth=0.5, effort=0.02)
    >>> study = BandwidthLimits(model, demands, dt=0.5, delay_samples=1.0, states=1)
    >>> list(study.tasks)
    ['PI', 'PID', 'order 1', 'full']
    >>> study.plant_at(1.0).performance
    2
    """

    model: UncertaintyModel
    demands: Demands
    dt: float
    delay_samples: float = field(default=0.0, kw_only=True)
    states: int = field(default=2, kw_only=True)
    noise_free: UncertaintyModel | None = field(default=None, kw_only=True)
    time_limit: float | None = field(default=None, kw_only=True)

    headline: ClassVar[str] = "certified_bandwidth_hz"

    def __post_init__(self) -> None:
        need_kind(self.demands, Demands, "demands")
        if self.demands.bandwidth is None:
            raise InputError("no bandwidth is demanded; give the one that the study is about")
        need_whole(self.states, "states")
        if self.states < 1:
            raise InputError(f"states is {self.states}; it must be 1 or more")
        need_positive(self.time_limit, "time_limit", or_none=True)
        need_kind(self.model, UncertaintyModel, "model")
        if self.model.form != "multiplicative":
            raise InputError("the model is additive; a multiplicative one is needed")
        self.plant_at(self.demands.bandwidth)  # raises InputError for demands that do not fit

    def plant_at(self, bandwidth: float) -> GeneralisedPlant:
        """The generalised plant of the demands with another bandwidth [rad/s]."""
        demands = replace(self.demands, bandwidth=bandwidth)
        return demanded_plant(self.model, demands, self.dt, delay_samples=self.delay_samples)

    @property
    def tasks(self) -> dict[str, dict[str, Any]]:
        """Requirements on the controller, by the name of its structure."""
        orders = {f"order {n}": {"order": n} for n in range(1, self.states + 1)}
        return {"PI": {"family": PI()}, "PID": {"family": PID()}, **orders, "full": {}}

    @part
    def made(self, context: Context) -> dict[tuple[str, int], tuple[float, StateSpace]]:
        """Certified peak and controller for each structure and bandwidth that was tried."""
        found = {}
        for name in context.track(list(self.tasks), "structures"):
            for k, omega in enumerate(self._bandwidths()):
                task = MuSynthesis(self.plant_at(omega), integral=True, **self.tasks[name])
                done = solve(task, options=Options(time_limit=self.time_limit))
                if done.answer is None or not (done.certificate and done.certificate.valid):
                    break
                found[name, k] = float(done.answer.upper), done.answer.K
                if done.answer.upper > HOPELESS:
                    break
        return found

    def _bandwidths(self) -> RealArray:
        assert self.demands.bandwidth is not None
        return self.demands.bandwidth * np.sqrt(2.0) ** np.array(STEPS)

    structure = dim(lambda self: list(self.tasks), meaning="structure of the controller")
    frequency = dim(lambda self: self._bandwidths() / (2 * np.pi), unit="Hz", meaning="bandwidth")
    limit_of = dim(lambda self: list(self._without_each_limit()), meaning="what is left out")

    @array(
        dims=(structure, frequency),
        unit="1",
        meaning="certified peak of mu; NaN where none was made",
    )
    def peak(self, made: Any) -> RealArray:
        every = [
            [made.get((name, k), (np.nan,))[0] for k in range(len(STEPS))] for name in self.tasks
        ]
        return np.array(every)

    @system(structure)
    def controller(self, made: Any, peak: DataArray) -> Mapping[str, StateSpace]:
        return {
            name: made[name, k][1]
            for name, k in zip(self.tasks, _best_columns(peak.values), strict=True)
            if k is not None
        }

    @array(dims=(limit_of,), unit="1", meaning="largest bandwidth without it over that with all")
    def growth(self, possible: DataArray) -> RealArray:
        without = [one().largest() for one in self._without_each_limit().values()]
        most = float(possible) * 2 * np.pi
        return np.array(without) / most if most else np.full(len(without), np.nan)

    @array(
        dims=(), unit="Hz", meaning="bandwidth that no controller can exceed, whatever its order"
    )
    def possible(self) -> float:
        return self._with_all_limits().largest() / (2 * np.pi)

    def _with_all_limits(self) -> LimitedBandwidth:
        return LimitedBandwidth(self.model, self.demands, self.dt, self.delay_samples)

    def _without_each_limit(self) -> dict[str, Any]:
        return relaxations(self._with_all_limits(), self.noise_free)

    # --- checks -----------------------------------------------------------------------------------

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        found = list(super().checks(answer, tolerance))
        for name, k in zip(self.tasks, _best_columns(answer["peak"].values), strict=True):
            if k is not None:
                loop = (
                    self.plant_at(self._bandwidths()[k])
                    .nominal()
                    .close(self.controller(answer)[name])
                )
                stable = stability_check(loop)
                found.append(replace(stable, name=f"{name} stable"))
        return found

    def second_opinion(self, answer: Dataset) -> list[Check]:
        """Try each stored controller with plants of the set, at sampled frequencies.

        Mu is at most p if the weighted loop is at most p for all plants with deviations up to 1 /
        p.
        """
        found = []
        for name, k in zip(self.tasks, _best_columns(answer["peak"].values), strict=True):
            if k is None:
                continue
            peak = float(answer["peak"].values[list(self.tasks).index(name), k])
            K, bandwidth = self.controller(answer)[name], float(self._bandwidths()[k])
            value = self._largest_sampled_norm(K, bandwidth, peak) / peak - 1
            statement = "largest weighted loop with a plant of the set, over the peak, less 1"
            over = f"at {FREQUENCIES} frequencies, for {3 * PHASES} plants at each"
            found.append(Check(f"{name} sampled", statement, value, PEAK_ROUNDING, over=over))
        return [*super().second_opinion(answer), *found]

    def _largest_sampled_norm(self, K: StateSpace, bandwidth: float, peak: float) -> float:
        """Largest norm of the weighted loop for plants with deviations of size 1 / peak."""
        omega = np.geomspace(1e-4 * bandwidth, 1e3 * bandwidth, FREQUENCIES)
        late = lateness(self.dt, self.delay_samples).response(omega)
        nominal, own = self.model.nominal.response(omega) * late, response(K, omega)[:, 0, 0]
        W_r = self.model.W_r
        along = np.zeros(omega.size) if W_r is None else W_r.response(omega)
        around = np.exp(2j * np.pi * np.arange(PHASES) / PHASES)
        circular = self.model.W_c.response(omega)
        away = circular[:, None, None] * around[:, None] + along[:, None, None] * [-1.0, 0.0, 1.0]
        S = 1 / (1 + (nominal * own)[:, None, None] * (1 + away / peak))
        loop = {"S": S, "T": 1 - S, "KS": own[:, None, None] * S}
        demands = replace(self.demands, bandwidth=bandwidth)
        rows = strictest(demands.weights(self.model.nominal, self.dt))
        squares = [
            np.abs(one.W.response(omega)[:, None, None] * loop[one.channel]) ** 2 for one in rows
        ]
        return float(np.sqrt(np.sum(squares, axis=0)).max())

    # --- what it says -----------------------------------------------------------------------------

    def certified(self, answer: Dataset) -> dict[str, float]:
        """Largest tried bandwidth [Hz] with a certified peak below 1, by structure; 0 for none."""
        peaks, tried = answer["peak"].values, answer["frequency"].values
        return {
            name: float(tried[row < 1].max(initial=0.0))
            for name, row in zip(self.tasks, peaks, strict=True)
        }

    def limit(self, answer: Dataset) -> str:
        """The part that limits the bandwidth most; "" where no single part does."""
        growth = answer["growth"].values
        if not np.isfinite(growth).any() or np.nanmax(growth) < CLEAR:
            return ""
        return str(answer["limit_of"].values[int(np.nanargmax(growth))])

    @metric
    def certified_bandwidth_hz(self, answer: Dataset) -> float:
        return max(self.certified(answer).values())

    @table
    def words(self, answer: Dataset) -> str:
        growth = answer["growth"].values
        name = self.limit(answer)
        if not float(answer["possible"]):
            return "No bandwidth was found at which all demands could be kept.\n"
        if not name:
            return "No single part limits the bandwidth: with any one left out it stays the same.\n"
        most = float(np.nanmax(growth))
        times = f"more than {most:.3g}" if most >= LARGEST_CHANGE else f"up to {most:.2g}"
        return (
            f"What limits the bandwidth most is **{name}**: without it a controller could have "
            f"{times} times the bandwidth.\n"
        )

    @table
    def structures(self, answer: Dataset) -> Any:
        kept = self.certified(answer)
        at = STEPS.index(0)
        demanded = answer["frequency"].values[at]
        heads = ["structure", "states", f"peak of mu at {demanded:.3g} Hz", "certified up to [Hz]"]
        controllers, tried = self.controller(answer), answer["frequency"].values
        rows = []
        for name, row in zip(self.tasks, answer["peak"].values, strict=True):
            states = str(controllers[name].nstates) if name in controllers else ""
            peak = f"{row[at]:.3g}" if np.isfinite(row[at]) else f"above {HOPELESS}"
            up_to = f"{kept[name]:.3g}" if kept[name] else f"none of {tried[0]:.3g} or more"
            rows.append([name, states, peak, up_to])
        return heads, rows

    @table
    def parts(self, growth: DataArray, possible: DataArray) -> Any:
        heads = ["left out", "largest bandwidth any controller could have [Hz]", "grows by"]
        rows = [["nothing", f"{float(possible):.3g}", "1"]]
        for name, one in zip(growth["limit_of"].values, growth.values, strict=True):
            rows.append([str(name), f"{one * float(possible):.3g}", f"{one:.2f}"])
        return heads, rows

    @figure
    def page(self, answer: Dataset) -> Mapping[str, Figure]:
        drawn, (left, right) = figures.axes(1, 2, size=(9.0, 3.8))
        tried = answer["frequency"].values
        for name, row in zip(self.tasks, answer["peak"].values, strict=True):
            left.plot(tried, row, marker="o", markersize=4, label=name)
        left.axhline(1.0, color=figures.BLACK, linewidth=0.8)
        figures.label(left, x="bandwidth [Hz]", y="certified peak of mu", log="x")
        growth = answer["growth"]
        names = [str(one) for one in growth["limit_of"].values][::-1]
        values = np.maximum(np.nan_to_num(growth.values, nan=1.0), 1.0)[::-1]
        right.barh(range(len(names)), values - 1, left=1.0, color=figures.BLUE, height=0.6)
        right.set_yticks(range(len(names)), names)
        right.axvline(1.0, color=figures.BLACK, linewidth=0.8)
        figures.label(right, x="largest bandwidth without it, over now")
        figures.legend_below(drawn, left, columns=6)
        return {"bandwidth": drawn}


def _best_columns(peaks: RealArray) -> list[int | None]:
    """Column of the largest bandwidth with a peak below 1, or else of the least peak, for
    each row.
    """
    found: list[int | None] = []
    for row in peaks:
        if not np.isfinite(row).any():
            found.append(None)
        elif (row < 1).any():
            found.append(int(np.flatnonzero(row < 1).max()))
        else:
            found.append(int(np.nanargmin(row)))
    return found
