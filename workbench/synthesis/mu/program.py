"""Mu synthesis as a Program: its data, its answer, its check."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from workbench.certify.stability import stability_of
from workbench.errors import InputError
from workbench.heavy_types import Dataset, Figure, StateSpace
from workbench.input_checks import need_positive
from workbench.mu import Peak, performance_peak
from workbench.program import Check, Program
from workbench.structure import Structure
from workbench.synthesis.hinf.figures import controller
from workbench.synthesis.mu.families import Family
from workbench.synthesis.mu.figures import bounds, rounds
from workbench.synthesis.mu.rounds import Iterate, packed, unpacked
from workbench.synthesis.mu.scalings import PARAMETERS
from workbench.systems.balancing import balanced
from workbench.systems.conversion import as_system, need_plant
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.minimal import visible
from workbench.systems.realisation import realisation
from workbench.systems.storage import restored, stored

TOLERANCE = 1e-3
"""Of certified peaks, relative."""
ROUND = "round_"
"""How variables of a dataset begin that have a value for each round."""
ROUNDING = 1e-9
"""By which bounds of the same loop may differ, relative."""


@dataclass(frozen=True, eq=False)
class MuController:
    """u = K y with positive feedback; the supremum of mixed mu lies in [``lower``, ``upper``].

    ``omega`` [rad/s] is the frequency of the lower bound.
    """

    K: StateSpace
    lower: float
    upper: float
    omega: float
    history: tuple[Iterate, ...] = field(default=())


@dataclass(frozen=True, eq=False)
class MuSynthesis(Program):
    """The stabilising K with the least supremum over frequency of mixed mu.

    Mu is that of robust performance: the plant's perturbation, and a full block that closes its
    performance. No method finds the global optimum; every answer's peak is certified.

    Parameters
    ----------
    plant
        With a structure, performance outputs and exogenous inputs.
    structure
        Of the perturbation; None: the plant's own.
    start
        A stabilising controller to begin with; None: the method's own.
    family
        Controllers that method "fixed" may choose from, the start among them; None: all of the
        start's order.
    random
        How many stabilising members of the family, drawn about the start, method "fixed" goes on
        from as well; the best of all is the answer.
    target
        Certified peak that is low enough: methods end there, and an answer above it does not hold.
        None: the least that they find.

    Raises
    ------
    InputError
        A plant without structure, performance or exogenous signals, or in discrete time; a start
        that does not fit or does not stabilise; a target that is not positive and finite.
    """

    plant: GeneralisedPlant
    structure: Structure | None = None
    start: StateSpace | None = None
    family: Family | None = None
    random: int = 0
    target: float | None = None

    default_method: ClassVar[str] = "dk"
    headline: ClassVar[str] = "peak"

    def __post_init__(self) -> None:
        need_plant(self.plant)
        need_positive(self.target, "target", or_none=True)
        if self.family is not None and not isinstance(self.family, Family):
            raise InputError(f"family must be a Family, not {type(self.family).__name__}")
        plant, structure = self.plant, self.structure or self.plant.structure
        if structure is None:
            raise InputError(
                "the plant has no perturbation: that is hinf's problem, give structure"
            )
        system = plant.system
        plant = visible(GeneralisedPlant(system, structure, plant.controls, plant.measurements))
        if not (plant.performance and plant.exogenous):
            raise InputError(
                f"the plant has {plant.exogenous} exogenous inputs and {plant.performance} "
                "performance outputs; mu synthesis needs one of each at least"
            )
        if system.dt:
            raise InputError(
                f"the plant is sampled (dt = {system.dt} s); give it in continuous time"
            )
        object.__setattr__(self, "plant", plant)
        object.__setattr__(self, "structure", structure)
        if self.start is not None:
            object.__setattr__(self, "start", as_system(self.start, "start"))
            stability = stability_of(plant.close(self.start))
            if not stability.holds:
                raise InputError(
                    "the start does not stabilise the plant: the loop has a pole with real part "
                    f"{stability.value:.3g} {stability.where}, which must be less than "
                    f"{stability.limit:.3g}, its rounding error"
                )

    @cached_property
    def closed(self) -> Structure:
        """The perturbation and the performance block."""
        return self.plant.performance_structure

    def certified(self, K: StateSpace, tolerance: float = TOLERANCE) -> Peak | None:
        """The peak of the loop; None where it is unstable."""
        return performance_peak(self.plant, K, tolerance)

    def answer(
        self, K: StateSpace, history: tuple[Iterate, ...] = (), tolerance: float = TOLERANCE
    ) -> MuController | None:
        """A controller, states balanced, with its certified peak; None where the loop is unstable.

        Responses of fifty states in other units are wrong by 1e-3 in tools that do not balance.
        """
        K = realisation((*balanced(K.A, K.B, K.C), K.D), 0.0)
        found = self.certified(K, tolerance)
        if found is None:
            return None
        return MuController(K, found.lower, found.upper, found.omega, history)

    def reaching(
        self, K: StateSpace, peak: float, history: tuple[Iterate, ...]
    ) -> MuController | None:
        """The answer of a controller whose peak at some frequencies is the target or lower.

        None without a target, or where the certified peak is above it. Nothing is certified more
        closely than that needs.
        """
        if self.target is None or peak > self.target:
            return None
        answer = self.answer(K, history, max((self.target / peak - 1.0) / 2, TOLERANCE))
        return answer if answer is not None and answer.upper <= self.target else None

    # --- checks -------------------------------------------------------------------------------

    def checks(self, answer: MuController, tolerance: float) -> list[Check]:
        K = answer.K
        fits = (K.noutputs, K.ninputs) == (self.plant.controls, self.plant.measurements)
        statement = "whether K has other outputs and inputs than controls and measurements"
        found = [Check("dimensions", statement, float(not fits), 0.0)]
        if not fits:
            return found
        stability = stability_of(self.plant.close(K))
        found.append(stability)
        certified = self.certified(K)
        upper = certified.upper if certified else np.inf
        statement = "certified supremum of mixed mu over the claimed bound, less 1"
        found.append(Check("peak", statement, upper / answer.upper - 1, TOLERANCE))
        statement = "claimed lower over certified upper bound, less 1"
        found.append(Check("lower", statement, answer.lower / upper - 1, ROUNDING))
        if self.target is not None:
            statement = "certified supremum of mixed mu over the target, less 1"
            found.append(Check("target", statement, upper / self.target - 1, ROUNDING))
        return found

    def metrics(self, answer: MuController) -> dict[str, float]:
        return {
            "peak": answer.upper,
            "peak_lower": answer.lower,
            "order": float(answer.K.nstates),
            "iterations": float(len(answer.history)),
        }

    # --- datasets and figures -----------------------------------------------------------------

    def to_dataset(self, answer: MuController) -> Dataset:
        import xarray as xr

        one = {"units": "1"}
        return xr.Dataset(
            {
                **stored("plant", self.plant.system),
                **stored("controller", answer.K),
                "peak": ("bound", [answer.lower, answer.upper], one | {"long_name": "mixed mu"}),
                "peak_omega": ((), answer.omega, {"units": "rad/s"}),
                **_rounds(answer.history),
            },
            coords={"bound": ["lower", "upper"]},
        )

    def from_dataset(self, data: Dataset) -> MuController:
        arrays = {
            str(name).removeprefix(ROUND): array.values
            for name, array in data.data_vars.items()
            if str(name).startswith(ROUND)
        }
        history = tuple(unpacked(arrays)) if arrays else ()
        lower, upper = data["peak"].values.tolist()
        omega = float(data["peak_omega"])
        return MuController(restored(data, "controller"), lower, upper, omega, history)

    def figures(self, answer: MuController) -> dict[str, Figure]:
        loop = self.plant.close(answer.K)
        found = {
            "mu": bounds(loop, self.closed, answer.upper),
            "controller": controller(answer.K, loop),
        }
        return found | ({"rounds": rounds(answer.history, answer.upper)} if answer.history else {})


def _rounds(history: tuple[Iterate, ...]) -> dict[str, Any]:
    """Variables of a dataset: every round's numbers, controller and scalings."""
    if not history:
        return {}
    controller = {
        "A": ("round_state", "round_state_"),
        "B": ("round_state", "controller_input"),
        "C": ("controller_output", "round_state"),
        "D": ("controller_output", "controller_input"),
    }
    found: dict[str, Any] = {"round": np.arange(1, len(history) + 1)}
    for name, array in packed(history).items():
        dims: tuple[str, ...] = ()
        about = {"units": "1"}
        kind, _, part = name.partition("_")
        if kind == "controller":
            dims = controller[part]
            about = {"long_name": f"{part} of each round's controller, NaN beyond its order"}
        elif kind == "scalings":
            dims = (f"{part}_block", f"{part}_parameter")
            about |= {"long_name": f"parameters of each round's scalings {part}: {PARAMETERS}"}
        found[ROUND + name] = (("round", *dims), array, about)
    return found
