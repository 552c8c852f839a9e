"""A Study of whether demands can be met together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import DataArray, Dataset, Figure
from workbench.certificate import EVERY_FREQUENCY, Check
from workbench.errors import InputError
from workbench.executor import Context
from workbench.input_checks import need_kind
from workbench.study import Study, array, check, dim, figure, metric, part, system, table
from workbench.synthesis.demands.conflict import Conflict, NominalDemands, find_conflict
from workbench.synthesis.demands.conflict_proof import demanded_loop, proof_basis, summed_excess
from workbench.synthesis.demands.demands import KINDS, Demands
from workbench.synthesis.demands.nominal_reach import row_norms
from workbench.synthesis.limits.dual_bound import DualCertificate
from workbench.systems.generalised_plant import response
from workbench.uncertainty import UncertaintyModel

SAMPLED = 2000
"""Number of frequencies at which the second opinion looks at loops and proofs."""
SHOWN, SHOWN_SIZES = (1e-3, 1e2), (1e-3, 1e3)
"""Ranges of the figure: frequencies relative to the crossover, and magnitudes."""
SAMPLED_ROUNDING = 1e-6
"""Relative excess allowed of a sampled response over its certified norm."""


@dataclass(frozen=True, eq=False)
class DemandConflict(Study):
    """Demands that no controller of any order can meet together on the nominal plant.

    The set found is irreducible: if any one demand is left out, a controller is found that
    satisfies the weights of all others, which is certified. An integral over all frequencies proves
    that no controller satisfies all of them, where a proof is found. The proof is for every linear
    controller that stabilises the plant and has no absurd gain. Without a proof the answer says
    only that no controller was found. For each demand of the set the search gives the number with
    which the rest can be met.

    Parameters
    ----------
    model
        Uncertainty model; continuous. Only its nominal is used.
    demands
        One or more demands.
    dt, delay_samples
        Sampling time [s] of the controller, and computation delay [samples].

    Raises
    ------
    InputError
        Nothing is demanded; or as in `demanded_plant`.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.synthesis import DemandConflict, Demands
    >>> from workbench.uncertainty import UncertaintyModel
    >>> G = control.tf([-1.0, 1.0], [1.0, 2.0, 1.0])  # a zero of 1 rad/s right of the axis
    >>> model = UncertaintyModel(G, control.tf([0.1], [1.0]))
    >>> study = DemandConflict(model, Demands(bandwidth=2.0, effort=0.01), dt=0.01)
    >>> solution = wb.solve(study)
    >>> solution.task.conflicting(solution.answer), solution.metrics["proven_level"] > 1
    (('bandwidth',), True)
    """

    model: UncertaintyModel
    demands: Demands
    dt: float
    delay_samples: float = field(default=0.0, kw_only=True)

    headline: ClassVar[str] = "conflicting_demands"

    def __post_init__(self) -> None:
        need_kind(self.model, UncertaintyModel, "model")
        need_kind(self.demands, Demands, "demands")
        if self.model.dt:
            raise InputError("the model is sampled; a continuous one is needed")
        if not self.demands.asked:
            raise InputError("nothing is demanded; give a bandwidth, for example")
        _ = self.nominal.weights(self.demands.asked)  # raises InputError for an invalid dt or delay

    @cached_property
    def nominal(self) -> NominalDemands:
        """The demands on the nominal plant."""
        return NominalDemands(self.model.nominal, self.demands, self.dt, self.delay_samples)

    @part
    def conflict(self, context: Context) -> Conflict:
        """The conflict that the search found."""
        return find_conflict(self.nominal, context)

    demand = dim(lambda self: list(self.demands.asked), meaning="demand")
    left_out = dim(lambda conflict: list(conflict.controllers), meaning="demand that is left out")

    @array(dims=demand, unit="", meaning="number that is demanded")
    def given(self) -> list[float]:
        return [float(getattr(self.demands, name)) for name in self.demands.asked]

    @array(dims=demand, unit="1", meaning="whether it is one of those that conflict")
    def member(self, conflict: Conflict) -> list[int]:
        return [int(name in conflict.names) for name in self.demands.asked]

    @array(dims=demand, unit="", meaning="number with which the rest of the conflict can be had")
    def would_do(self, conflict: Conflict) -> list[float]:
        def loosened(name: str) -> float:
            factor = conflict.factors.get(name, np.nan)
            if not np.isfinite(factor):
                return np.nan
            return float(getattr(self.demands.loosened(name, factor), name))

        return [loosened(name) for name in self.demands.asked]

    @system(left_out)
    def controller(self, conflict: Conflict) -> Mapping[str, Any]:
        return conflict.controllers

    @array(
        dims=("coefficient",),
        unit="1",
        meaning="coefficients of h, whose integral proves the conflict",
    )
    def proof(self, conflict: Conflict) -> RealArray:
        return np.empty(0) if conflict.proof is None else conflict.proof.coefficients

    @array(
        dims=(),
        unit="1",
        meaning="largest level that is proven: one weight exceeds it with every controller",
    )
    def level(self, conflict: Conflict) -> float:
        return np.nan if conflict.proof is None else conflict.proof.level

    # --- checks -----------------------------------------------------------------------------------

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        return [*super().checks(answer, tolerance), *self._kept(answer)]

    def _kept(self, answer: Dataset) -> list[Check]:
        """Check that each controller satisfies each weight it was designed for."""
        found = []
        G = self.nominal.plant.state_space()
        for name, K in self.controller(answer).items():
            weights = self.nominal.weights(self._names_without(answer, name))
            excess = float(row_norms(G, K, weights).max()) - 1.0
            words = f"all but {name}" if name else "all demands"
            statement = "largest certified norm of a weighted transfer function, less 1"
            found.append(
                Check(
                    f"{words} together", statement, excess, 0.0, over=EVERY_FREQUENCY, proven=True
                )
            )
        return found

    @check(
        title="conflict", statement="upper bound of the integral of the proof, over that of |h|",
        at_most=0.0, over="for every frequency and every controller",
    )  # fmt: skip
    def proven(self, proof: DataArray, level: DataArray, member: DataArray) -> float | None:
        found = self._certificate(proof, level, member)
        return None if found is None else float(found[0].excess(found[1]))

    def _certificate(self, proof: Any, level: Any, member: Any) -> Any:
        """The stored proof, and the loop for which it holds."""
        if not proof.size:
            return None
        names = [one for one, is_in in zip(self.demands.asked, member.values, strict=True) if is_in]
        weights = self.nominal.weights(names)
        basis = proof_basis(self.nominal.plant, weights)
        certificate = DualCertificate(float(level), np.asarray(proof.values), basis)
        return certificate, demanded_loop(self.nominal.plant, weights, float(level))

    def second_opinion(self, answer: Dataset) -> list[Check]:
        """Try each controller at sampled frequencies, and sum the proof's integral over points."""
        plant = self.nominal.plant
        found = []
        for name, K in self.controller(answer).items():
            omega = self._sampled()
            L = plant.response(omega) * response(K, omega)[:, 0, 0]
            S = 1 / (1 + L)
            loop = {"S": S, "T": L * S, "KS": L * S / plant.response(omega)}
            weights = self.nominal.weights(self._names_without(answer, name))
            most = max(
                float(np.abs(one.W.response(omega) * loop[one.channel]).max()) for one in weights
            )
            words = f"sampled, without {name}" if name else "sampled"
            statement = "largest weighted transfer function, less 1"
            over = f"at {omega.size} frequencies"
            found.append(Check(words, statement, most - 1, SAMPLED_ROUNDING, over=over))
        made = self._certificate(answer["proof"], answer["level"], answer["member"])
        if made is not None:
            statement = "sum over points of the largest Re(T h), less that of any controller"
            found.append(Check("sampled proof", statement, summed_excess(*made), 0.0))
        return [*super().second_opinion(answer), *found]

    def _sampled(self) -> RealArray:
        weights = self.nominal.weights(self.demands.asked)
        roots = np.abs(
            np.concatenate([one.W.poles for one in weights] + [self.nominal.plant.poles])
        )
        roots = roots[roots > 0]
        return np.geomspace(roots.min() / 100, 100 * roots.max(), SAMPLED)

    def _names_without(self, answer: Dataset, name: str) -> list[str]:
        return [one for one in self.conflicting(answer) or self.demands.asked if one != name]

    # --- what it says -----------------------------------------------------------------------------

    def conflicting(self, answer: Dataset) -> tuple[str, ...]:
        """Names of the demands that conflict; empty where all can be met together."""
        return tuple(answer["demand"].values[answer["member"].values > 0].tolist())

    @metric
    def conflicting_demands(self, member: DataArray) -> float:
        return float(member.sum())

    @metric
    def proven_level(self, level: DataArray) -> float | None:
        return float(level) if np.isfinite(float(level)) else None

    @table
    def words(self, member: DataArray, level: DataArray, would_do: DataArray) -> str:
        names = [one for one in self.demands.asked if float(member.sel(demand=one))]
        if not names:
            return "All demands can be had together on the nominal plant, each weight by itself.\n"
        said = " and ".join(KINDS[name].words for name in names)
        if np.isfinite(float(level)):
            how = (
                "**cannot be had together**: proven for the nominal plant, whatever the order of "
                f"the controller; one weight is exceeded by a factor of {float(level):.3g} at least"
            )
            if len(names) == 1:
                how = how.replace("together", "even alone")
        else:
            how = "were **not found together**; that they exclude each other is not proven"
        rest = "Without any one of them the others can be had. " if len(names) > 1 else ""
        return f"{said[0].upper()}{said[1:]} {how}. {rest}\n"

    @table
    def demanded(self, given: DataArray, member: DataArray, would_do: DataArray) -> Any:
        heads = ["demand", "number", "in the conflict", "would have to be, the rest as it is"]
        rows = []
        for name in self.demands.asked:
            is_in, enough = bool(member.sel(demand=name)), float(would_do.sel(demand=name))
            give = "" if not is_in else f"{enough:.3g}" if np.isfinite(enough) else "not this alone"
            unit = KINDS[name].unit
            shown = KINDS[name].words if unit in ("1", "u") else f"{KINDS[name].words} [{unit}]"
            value = float(given.sel(demand=name))
            rows.append([shown, f"{value:.4g}", "yes" if is_in else "no", give])
        return heads, rows

    @figure
    def together(self, answer: Dataset) -> Mapping[str, Figure]:
        drawn, panels = figures.axes(1, 3, size=(9.0, 3.4), sharey=True)
        speed = self.nominal.speed
        omega = np.geomspace(SHOWN[0] * speed, SHOWN[1] * speed, SAMPLED)
        P = self.nominal.plant.response(omega)
        names = self.conflicting(answer) or self.demands.asked
        weights = self.demands.only(names).weights(self.model.nominal, self.dt, beside=self.demands)
        for panel, channel, title in zip(panels, ("S", "T", "KS"), ("S", "T", "K S"), strict=True):
            for name, K in self.controller(answer).items():
                L = P * response(K, omega)[:, 0, 0]
                loop = {"S": 1 / (1 + L), "T": L / (1 + L), "KS": L / (1 + L) / P}
                words = f"without: {KINDS[name].words}" if name else "a controller for all"
                panel.plot(omega / (2 * np.pi), np.abs(loop[channel]), label=words)
            for one in weights:
                if one.channel == channel:
                    bound = 1 / np.abs(one.W.response(omega))
                    panel.plot(omega / (2 * np.pi), bound, color=figures.BLACK, linestyle="--")
            figures.label(panel, x="frequency [Hz]", title=f"$|{title}|$", log="xy")
        panels[0].set_ylim(*SHOWN_SIZES)
        panels[0].plot([], [], color=figures.BLACK, linestyle="--", label="what is demanded")
        figures.legend_below(drawn, panels[0])
        return {"demands": drawn}
