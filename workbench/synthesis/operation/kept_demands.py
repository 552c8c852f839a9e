"""Comparison of each demand with the value reached on each measured plant, with the controller's
code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import DataArray, Figure
from workbench.errors import InputError
from workbench.input_checks import need_kind
from workbench.study import array, dim, figure, metric, table
from workbench.synthesis.demands.demands import KINDS, SETTLED, Demands
from workbench.synthesis.demands.reached import reached_by_responses, recovery_time
from workbench.synthesis.operation.loop_in_time import loop_in_time
from workbench.synthesis.operation.working_loop import WorkingLoop
from workbench.uncertainty import UncertaintyModel

NOISE_SAMPLES = 4000
"""Number of samples at rest from which the rms of the control is computed."""
LEAST, MOST_SHOWN = 1e-9, 3.0
"""Least value reached, which avoids division by zero, and the right end of the figure."""
LIMITS = "limits"
"""Name of the limits of the control among the demands."""


@dataclass(frozen=True, eq=False)
class KeptDemands(WorkingLoop):
    """A `WorkingLoop` that says whether each demand is met on each measured plant.

    Overshoot, times and largest controls come from the simulated loop with limits. The rms of the
    control comes from a simulation at rest with the noise of the demands. The bandwidth and the
    effort come from the frequency responses of the sampled loop. A missed demand is reported; it is
    no failure of the study.

    Parameters
    ----------
    responses, board, step, disturbance, noise, seed
        As in `WorkingLoop`. Without a step, the step of the demands is used.
    demands
        One or more demands.
    peak
        Certified peak of mu of the design, shown for comparison; None if it is not known.

    Raises
    ------
    InputError
        As in `WorkingLoop`; nothing is demanded; or the plant of the board is not an
        `UncertaintyModel`.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.synthesis import Demands, Implementation, KeptDemands, WorkingPoint
    >>> from workbench.uncertainty import CircleCover, Responses
    >>> omega = np.geomspace(0.01, 10, 60)
    >>> values = np.array([gain / (1j * omega + 1) for gain in (0.9, 1.0, 1.1)]).T
    >>> plants = Responses(omega=omega, values=values)
    >>> cover = wb.solve(CircleCover(plants, order=1))
    >>> given = {"limits": (0.0, 100.0), "working_point": WorkingPoint(50.0, 20.0)}
    >>> K = control.tf([2.0, 1.0], [1.0, 0.0])
    >>> board = wb.solve(Implementation(cover, K, dt=0.05, **given))
    >>> demands = Demands(overshoot=0.05, settling_time=2.0)
    >>> loop = wb.solve(KeptDemands(plants, board, demands))
    >>> loop.metrics["missed_overshoot"], loop.metrics["missed_settling_time"]
    (0.0, 3.0)
    """

    demands: Demands
    peak: float | None = field(default=None, kw_only=True)

    headline: ClassVar[str] = "missed"

    def __post_init__(self) -> None:
        need_kind(self.demands, Demands, "demands")
        if not self.demands.asked:
            raise InputError("nothing is demanded; give a bandwidth, for example")
        if self.step is None and self.demands.setpoint_step:
            object.__setattr__(self, "step", self.demands.setpoint_step)
        super().__post_init__()
        if not isinstance(self.task.loop.model, UncertaintyModel):
            raise InputError(
                "the implementation was made for a single plant; it needs an UncertaintyModel"
            )

    @property
    def asked(self) -> dict[str, float]:
        """The numbers demanded by name, including the limits of the control, if there are any."""
        found = {name: float(getattr(self.demands, name)) for name in self.demands.asked}
        return found if self.actuator.deviations is None else {**found, LIMITS: 1.0}

    demand = dim(lambda self: list(self.asked), meaning="demand")

    @array(dims=demand, unit="", meaning="number that is demanded")
    def demanded(self) -> list[float]:
        return list(self.asked.values())

    @array(dims=("plant", demand), unit="", meaning="number that is reached")
    def reached(self, signals: DataArray, step_size: DataArray, loops: Any) -> RealArray:
        period, half = self.task.dt, signals.sizes["time"] // 2
        y, u = (signals.sel(signal=name).values for name in "yu")
        overshoot, settling = self._step_quality(signals, step_size)
        recovery = recovery_time(y[:, half:] - y[:, half - 1 : half], period)
        deviations = u - self.point.u[0]
        found = {
            "overshoot": overshoot,
            "settling_time": settling,
            "recovery_time": recovery,
            "control_range": np.abs(deviations[:, :half]).max(axis=1),
        }
        if self.actuator.deviations is not None:
            low, high = (float(limit[0]) for limit in self.actuator.deviations)
            found[LIMITS] = np.maximum(deviations / low, deviations / high).max(axis=1)
        if "control_rms" in self.asked:
            found["control_rms"] = self._control_rms_at_rest(loops)
        model, K = self.task.loop.model, self.board.answer.K
        assert model is not None
        of_responses = [
            reached_by_responses(
                one.loop_of(K).held(), K, self.actuator.sign, self.demands, model.nominal
            )
            for one in loops
        ]
        for name in of_responses[0]:
            found[name] = np.array([one[name] for one in of_responses])
        return np.stack([found[name] for name in self.asked], axis=1)

    def _control_rms_at_rest(self, loops: Any) -> RealArray:
        """Rms (N,) of the control that the noise of the demands causes at the working point."""
        rng = np.random.default_rng(self.seed)
        K, rest = self.board.answer.K, np.full(NOISE_SAMPLES, self.point.y[0])
        still = np.zeros(NOISE_SAMPLES)
        controls = [
            loop_in_time(
                one.loop_of(K).held(), K, self.actuator, rest, still,
                self.demands.noise * rng.standard_normal(NOISE_SAMPLES),
            )[1]
            for one in loops
        ]  # fmt: skip
        return np.std(controls, axis=1)

    def _demand_ratios(self, reached: DataArray, demanded: DataArray) -> RealArray:
        """Ratio of reached to demanded value (plants, demands), or its inverse; above 1 for a
        missed demand.
        """
        easier = np.array([name == LIMITS or KINDS[name].harder_if_small for name in self.asked])
        values, asked = np.asarray(reached), np.asarray(demanded)
        # For a demand of no overshoot, an overshoot within the settling limit is accepted.
        asked = np.where(asked == 0, SETTLED, asked)
        found: RealArray = np.where(easier, values / asked, asked / np.maximum(values, LEAST))
        return found

    @metric
    def missed_demands(self, reached: DataArray, demanded: DataArray) -> dict[str, float]:
        over = self._demand_ratios(reached, demanded) > 1
        return {
            "missed": float(over.sum()),
            **{f"missed_{name}": float(over[:, k].sum()) for k, name in enumerate(self.asked)},
        }

    @table
    def words(self, reached: DataArray, demanded: DataArray) -> Mapping[str, Any]:
        ratio = self._demand_ratios(reached, demanded)
        names = list(map(str, self.responses.plants))
        heads = ["demand", "demanded", "worst", "on", "verdict"]
        rows = []
        for k, (name, limit) in enumerate(self.asked.items()):
            worst, over = int(ratio[:, k].argmax()), int((ratio[:, k] > 1).sum())
            verdict = "kept by every plant" if not over else f"**missed by {over} of {len(names)}**"
            value = float(reached.values[worst, k])
            rows.append([self._words(name), f"{limit:.4g}", f"{value:.4g}", names[worst], verdict])
        each = [
            [plant, *(f"{value:.4g}{'' if one <= 1 else ' (missed)'}"
                      for value, one in zip(values, over, strict=True))]
            for plant, values, over in zip(names, reached.values, ratio, strict=True)
        ]  # fmt: skip
        every = [["demanded", *(f"{limit:.4g}" for limit in self.asked.values())], *each]
        found: dict[str, Any] = {
            "demands": (heads, rows),
            "demands-by-plant": (["plant", *map(self._words, self.asked)], every),
        }
        if self.peak is not None:
            said = (
                f"The weights that the demands became: certified peak of mu {self.peak:.4g}; every "
                f"plant of the cover {'keeps' if self.peak < 1 else '**may miss**'} them.\n"
            )
            found["certificate-for-the-set"] = said
        return found

    def _words(self, name: str) -> str:
        if name == LIMITS:
            return "control over its room to the limits"
        words, unit, _ = KINDS[name]
        unit = self.point.u_unit if unit == "u" else unit
        return words if unit in ("", "1") else f"{words} [{unit}]"

    @figure
    def verdicts(self, reached: DataArray, demanded: DataArray) -> Mapping[str, Figure]:
        ratio = self._demand_ratios(reached, demanded)
        names = list(self.asked)
        height = 1.2 + 0.38 * (len(names) + (self.peak is not None))
        drawn, (panel,) = figures.axes(1, 1, size=(7.0, height))
        for k in range(len(names)):
            place = len(names) - 1 - k
            kept = ratio[:, k] <= 1
            for chosen, color, mark in ((kept, figures.BLUE, "o"), (~kept, figures.ORANGE, "X")):
                shown = np.minimum(ratio[chosen, k], MOST_SHOWN)
                panel.plot(
                    shown, np.full(shown.size, place), mark, color=color, alpha=0.7, markersize=6
                )
        labels = [self._words(name).partition(" [")[0] for name in names][::-1]
        if self.peak is not None and math.isfinite(self.peak):
            panel.plot(self.peak, len(names), "D", color=figures.BLACK, markersize=6)
            labels.append("peak of mu, the set")
        panel.axvline(1.0, color=figures.BLACK, linewidth=0.8)
        panel.set_yticks(range(len(labels)), labels)
        panel.set_ylim(-0.6, len(labels) - 0.4)
        figures.label(panel, x="reached over demanded (above 1: missed)")
        return {"demands": drawn}
