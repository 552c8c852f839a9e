"""H2 synthesis as a Program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from workbench._core.heavy_types import Dataset, Figure, StateSpace
from workbench.certificate import THIS_SYSTEM, Check, relative_excess
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.mu.frequency.norms import SUM_ROUNDING, h2_norm
from workbench.second_opinion import loops
from workbench.second_opinion.powers import root_energy
from workbench.synthesis.families.family import asked_of
from workbench.synthesis.families.synthesis import ControllerSynthesis
from workbench.synthesis.h2.direct import DIRECT_TERM_ROUNDING, cancelling_gain, direct_term
from workbench.synthesis.h_infinity import figures as drawn
from workbench.synthesis.h_infinity.assumptions import need_all_stabilisable, scaled_if_regular
from workbench.synthesis.h_infinity.normalised import Scaled
from workbench.systems.conversion import need_plant
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.hidden_states import visible
from workbench.systems.margins import highest_crossover
from workbench.systems.realisation import in_words, matrices_of, pole_sizes, realisation
from workbench.systems.standard_plant import StandardPlant, standard_plant
from workbench.systems.storage import restored_system, stored_system

CLAIM_TOLERANCE = 1e-9
"""Share by which the proven norm of a loop may exceed the claimed one."""
LEAST_TOLERANCE = 1e-6
"""Share by which the norm of a loop may lie below the least norm, which is computed but not
proven.
"""


@dataclass(frozen=True, eq=False, repr=False)
class H2Controller(drawn.DrawnController):
    """A controller u = K y with positive feedback, and the H2 norm of its loop.

    Unlike a `StateSpace`, it has the proven H2 norm of its loop.

    ``norm`` is a proven upper bound. ``least`` is the norm of the best of all controllers; NaN if
    it is not known.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import lqg
    >>> answer = lqg(control.ss([[1.0]], [[1.0]], [[1.0]], 0), Q=1, R=1, W=1, V=1)
    >>> answer.K.nstates, round(answer.norm**2, 2)
    (1, 16.49)
    """

    K: StateSpace
    norm: float
    least: float = field(default=math.nan, kw_only=True)

    @property
    def lti(self) -> StateSpace:
        """The controller."""
        return self.K

    def summary(self) -> str:
        least = "" if math.isnan(self.least) else f", the least of all {self.least:.6g}"
        return f"H2Controller: {in_words(self.K)}\n  H2 norm {self.norm:.6g}{least}"


def h2_loop(plant: GeneralisedPlant, controller: StateSpace) -> StateSpace:
    """The closed loop. A direct term that is only rounding of terms that cancel is set to zero."""
    closed = plant.close(controller)
    dt = float(plant.system.dt or 0.0)
    if (
        dt
        or not closed.D.any()
        or direct_term(standard_plant(plant), controller.D) > DIRECT_TERM_ROUNDING
    ):
        return closed
    A, B, C, D = matrices_of(closed)
    return realisation((A, B, C, 0.0 * D), dt)


@dataclass(frozen=True, eq=False)
class H2Synthesis(ControllerSynthesis):
    """The stabilising K with the least H2 norm of F_l(P, K).

    With white noise of intensity 1 (in sampled time of variance 1) at all exogenous inputs, the
    performance outputs have this root mean square.

    Parameters
    ----------
    plant
        Generalised plant. Perturbation channels, if there are any, count as exogenous inputs and
        performance outputs. In continuous time the norm is infinite unless a gain cancels the
        direct term of w -> z. If D12 or D21 lacks rank, or there are zeros on the stability
        boundary, methods perturb the plant a little. The certificate holds for the given plant.
    order, family, stable, fastest_pole, largest_gain, start, random
        As in `HinfSynthesis`.
    further_plants
        As in `HinfSynthesis`: the norm is the largest of the H2 norms of all loops.

    Raises
    ------
    InputError
        The plant is not stabilisable or not detectable, is not finite or lacks signals; every loop
        has an infinite norm; or a requirement on the controller is not valid or does not fit.

    References
    ----------
    Zhou, Doyle, Glover, Robust and Optimal Control (1996), chapter 14; T. Chen, B. Francis, Optimal
    Sampled-Data Control Systems (1995), chapter 6.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.synthesis import H2Synthesis
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.ss([[1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> plant = generalised_plant(
    ...     [(G, "v", "x")],
    ...     {"v": "u + d", "y": "x + n"},
    ...     exogenous=["d", "n"],
    ...     performance=["x", "u"],
    ...     control="u",
    ...     measurement="y",
    ... )
    >>> solution = wb.solve(H2Synthesis(plant))
    >>> solution.certificate.holds, round(solution.answer.norm, 4)
    (True, 4.0602)
    """

    default_method: ClassVar[str] = "riccati"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.synthesis.h2.methods",
        "workbench.synthesis.h2.conic",
        "workbench.synthesis.mu.structured.least_energy",
    )
    headline: ClassVar[str] = "norm"

    def __post_init__(self) -> None:
        need_plant(self.plant)
        object.__setattr__(self, "plant", visible(self.plant))
        _ = self.scaled  # raises InputError for hidden modes
        if not self.plant.system.dt:
            cancelling_gain(self.standard)  # raises InputError where the norm is infinite
        self._set_form()
        need_all_stabilisable(self.further_plants)
        for plant in () if self.plant.system.dt else self.further_plants:
            cancelling_gain(standard_plant(plant))

    @property
    def closed_plant(self) -> GeneralisedPlant:
        return self.plant

    @cached_property
    def standard(self) -> StandardPlant:
        """Matrices of the plant with its partition into signals."""
        return standard_plant(self.plant)

    @cached_property
    def scaled(self) -> Scaled | None:
        """The scaled continuous-time plant; None where the plant must be perturbed."""
        return scaled_if_regular(self.standard)

    def objective(self, answer: H2Controller) -> float:
        """The H2 norm of the closed loop."""
        return answer.norm

    # --- checks -------------------------------------------------------------------------------

    def checks(self, answer: H2Controller, tolerance: float) -> list[Check]:
        K = answer.K
        fits = (K.noutputs, K.ninputs) == (self.plant.controls, self.plant.measurements)
        statement = "whether K has other outputs and inputs than controls and measurements"
        found = [Check("dimensions", statement, float(not fits), 0.0)]
        if not fits:
            return found
        found += [stability_check(self.loop(K)), *self.demands.checks(K)]
        if not found[1].holds:
            return found
        if not self.plant.system.dt:
            statement = "direct term of the loop, w -> z, over the terms that cancel"
            value = max(direct_term(standard_plant(plant), K.D) for plant in self.plants)
            found.append(Check("direct", statement, value, DIRECT_TERM_ROUNDING, over=THIS_SYSTEM))
        value = relative_excess(self.largest_norm(K), answer.norm)
        statement = "proven H2 norm of the loop over the claimed one, less 1"
        found.append(
            Check("norm", statement, value, CLAIM_TOLERANCE, over=THIS_SYSTEM, proven=True)
        )
        if not math.isnan(answer.least):
            statement = "least norm of all controllers over the norm that this one has, less 1"
            value = relative_excess(answer.least, answer.norm)
            found.append(Check("least", statement, value, LEAST_TOLERANCE, over=THIS_SYSTEM))
        return found

    def second_opinion(self, answer: H2Controller) -> list[Check]:
        loop, each = self.loop(answer.K), self.loops(answer.K)
        size = max(root_energy(*matrices_of(one), float(one.dt or 0.0)) for one in each)
        statement = "H2 norm of the loop, as a sum over samples, over the claimed one, less 1"
        value = relative_excess(size, answer.norm)
        return [
            loops.powers_fall(loop.A, loop.dt),
            Check("summed", statement, value, SUM_ROUNDING, over=THIS_SYSTEM),
        ]

    def facts(self, answer: H2Controller) -> Sequence[str]:
        crossover = highest_crossover(self.plant.controlled(), answer.K)
        said = [f"controller: {in_words(answer.K)}, crossover {crossover:.4g} Hz"]
        if asked_of(self) and answer.least > 0:
            said.append(
                f"norm {answer.norm:.4g} reached; that of the best controller of any order is "
                f"{answer.least:.4g}: distance {answer.norm / answer.least - 1:.1%}"
            )
        return said

    def metrics(self, answer: H2Controller) -> dict[str, float]:
        return {
            "norm": answer.norm,
            "order": float(answer.K.nstates),
            "crossover_hz": highest_crossover(self.plant.controlled(), answer.K),
            "fastest_pole_rad_s": float(pole_sizes(answer.K).max(initial=0.0)),
            "stable_controller": float(stability_check(answer.K).holds),
        }

    def loops(self, controller: StateSpace) -> list[StateSpace]:
        """The closed loops of all plants."""
        return [h2_loop(plant, controller) for plant in self.plants]

    def largest_norm(self, controller: StateSpace) -> float:
        """The largest proven H2 norm of a controller's loops, which are stable.

        Raises InputError if rounding hides whether a loop is stable.
        """
        return max(h2_norm(loop).upper for loop in self.loops(controller))

    def answer(self, controller: StateSpace, *, least: float = math.nan) -> H2Controller | None:
        """The answer for a controller; None where its loop has no proven finite norm."""
        K = self.plant.named(controller)
        if not stability_check(self.loop(K)).holds:
            return None
        try:
            norm = self.largest_norm(K)
        except InputError:  # rounding hides whether a pole is stable
            return None
        return H2Controller(K, norm, least=least) if np.isfinite(norm) else None

    # --- datasets and figures -----------------------------------------------------------------

    def figures(self, answer: H2Controller) -> dict[str, Figure]:
        closed = self.plant.close(answer.K)
        return {
            "loop": drawn.loop(closed),
            "controller": drawn.controller(answer.K, closed),
        }

    def to_dataset(self, answer: H2Controller) -> Dataset:
        import xarray as xr

        units = {"units": "1"}
        return xr.Dataset(
            {
                **stored_system("plant", self.plant.system),
                **stored_system("controller", answer.K),
                "norm": ((), answer.norm, units | {"long_name": "H2 norm of the closed loop"}),
                "least": ((), answer.least, units | {"long_name": "least H2 norm of all loops"}),
            }
        )

    def from_dataset(self, data: Dataset) -> H2Controller:
        K = self.plant.named(restored_system(data, "controller"))
        return H2Controller(K, float(data["norm"]), least=float(data["least"]))
