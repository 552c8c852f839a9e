"""Fault estimation as a Program: its data, its answer, its checks.

A filter u_f = K y estimates the faults, z = f - u_f, whatever the disturbances and whichever plant
of the set it sits on (E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003),
eq. 7.24 to 7.29; J. Stoustrup, M. Grimble, H. Niemann, Design of integrated systems for the control
and detection of actuator and sensor faults, Sensor Review 17 (1997) 138-149).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from workbench._core.heavy_types import Dataset, Figure, StateSpace
from workbench.certificate import EVERY_FREQUENCY, EVERY_PERTURBATION, Check, relative_excess
from workbench.certify.stability import stability_check
from workbench.diagnosis.estimation.figures import RequirementLoop, channels, fault_filter
from workbench.diagnosis.estimation.weighting import (
    EVERYWHERE,
    TOGETHER,
    Requirement,
    estimation_plant,
)
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.mu import Peak, peak
from workbench.mu.frequency.peak_bounds import peak_checks, restored_peak, stored_peak
from workbench.program import Program
from workbench.second_opinion import loops
from workbench.synthesis.h_infinity.figures import DrawnController
from workbench.synthesis.h_infinity.program import HinfSynthesis
from workbench.synthesis.mu.program import PEAK_TOLERANCE
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import GeneralisedPlant, Signals
from workbench.systems.realisation import in_words
from workbench.systems.storage import restored_system, stored_system

LEAST_TOLERANCE = 0.02
"""Largest relative distance between a claimed least norm and the recomputed one: twice that of the
lowest accuracy, which distinguishes levels to 1e-2.
"""


class Channel(NamedTuple):
    """A requirement in the weighted plant: indices of its exogenous inputs, its band [rad/s]."""

    name: str
    inputs: tuple[int, ...]
    band: tuple[float, float]


@dataclass(frozen=True, eq=False, repr=False)
class FaultFilter(DrawnController):
    """A filter u_f = K y with certified bounds of its errors on the whole set of plants.

    Unlike a `StateSpace`, it has proven bounds of its errors for all plants.

    Norms are divided by the required bounds, so a peak below 1 meets its requirement. ``peaks``
    (requirements, 2) has the lower and the upper bound of each requirement's peak. ``stacked`` (2,)
    has those for all requirements together, at all frequencies. ``least`` is the least norm of all
    requirements together that was found for the nominal plant; NaN if none was looked for.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.diagnosis import FaultEstimation, Requirement
    >>> from workbench.uncertainty import generalised_plant
    >>> lag = control.tf([1.0], [1.0, 0.5])
    >>> plant = generalised_plant(
    ...     [(lag, "d", "x")], {"y": "x + f"}, exogenous=["d", "f"], measurement="y"
    ... )
    >>> slow, fast = control.tf([1.0], [1.0, 0.01]), control.tf([1.0, 0.1], [1.0, 2.0])
    >>> wanted = [Requirement("leakage", "d", weight=slow), Requirement("error", "f", weight=fast)]
    >>> answer = wb.solve(FaultEstimation(plant, "f", requirements=wanted), method="riccati").answer
    >>> answer.peaks.shape, bool(answer.lower <= answer.upper)
    ((2, 2), True)
    """

    K: StateSpace
    peaks: np.ndarray
    stacked: np.ndarray
    _: KW_ONLY
    least: float = math.nan
    history: tuple[float, ...] = field(default=())
    """Largest upper bound of each round of an iteration."""
    proven: tuple[Peak | None, ...] = ()
    """The proofs of the bounds: one for each requirement, and one for all together."""

    @property
    def lti(self) -> StateSpace:
        """The filter."""
        return self.K

    def summary(self) -> str:
        return (
            f"FaultFilter: {in_words(self.K)}\n"
            f"  errors over those required from {self.lower:.4g} to {self.upper:.4g}"
        )

    @property
    def upper(self) -> float:
        """The largest upper bound of a requirement."""
        return float(self.peaks[:, 1].max())

    @property
    def lower(self) -> float:
        """The largest lower bound of a requirement."""
        return float(self.peaks[:, 0].max())


@dataclass(frozen=True, eq=False, init=False)
class FaultEstimation(Program):
    """The stable filter K that meets its requirements best, for every plant of the set.

        z = f - K y,    ||W_i w_i -> z|| < bound_i  at frequencies of band_i

    where W_i w_i drives the disturbances or the faults of requirement i. The peak is the largest of
    these norms over its bound, the supremum over frequency of mixed mu where the plant is
    uncertain. Without uncertainty the least norm of all requirements together, stacked, is a convex
    problem, which method "riccati" and the conic solvers solve; the other methods start from its
    solution.

    Parameters
    ----------
    plant
        The plant that the filter observes; stable, with its controller included if it has one. Its
        inputs are (perturbation, disturbances and faults), its outputs (perturbation,
        measurements); it has no controls and no performance outputs.
    faults
        Names or numbers of the exogenous inputs to be estimated.
    requirements
        Bounds of the error for faults and for disturbances. None: one requirement for the
        faults and one for the disturbances, each with weight and bound 1.
    start
        A filter. Method "basis" keeps its poles and its input matrix. None: the filter of method
        "riccati".

    Raises
    ------
    InputError
        A plant that is not stable, has controls or performance outputs, or no measurements; faults
        that the measurements do not show, or that cannot be told from each other; requirements as
        of `Requirement`, on signals that the plant does not have, or none on the faults; a start
        that does not fit or is not stable.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.diagnosis import FaultEstimation, Requirement
    >>> from workbench.uncertainty import generalised_plant
    >>> lag = control.tf([1.0], [1.0, 0.5])
    >>> plant = generalised_plant(
    ...     [(lag, "d", "x")], {"y": "x + f"}, exogenous=["d", "f"], measurement="y"
    ... )
    >>> slow, fast = control.tf([1.0], [1.0, 0.01]), control.tf([1.0, 0.1], [1.0, 2.0])
    >>> wanted = [Requirement("leakage", "d", weight=slow), Requirement("error", "f", weight=fast)]
    >>> solution = wb.solve(FaultEstimation(plant, "f", requirements=wanted), method="riccati")
    >>> solution.certificate.holds, solution.answer.K.ninputs
    (True, 1)
    """

    plant: GeneralisedPlant
    channels: tuple[Channel, ...]
    start: StateSpace | None

    default_method: ClassVar[str] = "riccati"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.diagnosis.estimation.methods",
        "workbench.diagnosis.estimation.basis",
    )
    headline: ClassVar[str] = "peak"

    def __init__(
        self,
        plant: GeneralisedPlant,
        faults: Signals,
        *,
        requirements: Sequence[Requirement] | None = None,
        start: Any = None,
    ) -> None:
        weighted, met, ends = estimation_plant(plant, faults, requirements)
        channels = tuple(
            Channel(one.name, tuple(range(first, last)), one.band)
            for one, first, last in zip(met, ends[:-1], ends[1:], strict=True)
        )
        if start is not None:
            start = as_system(start, "start")
            if start.dt:
                raise InputError(f"the start is sampled at {start.dt} s; the plant is continuous")
            fits = (weighted.controls, weighted.measurements)
            if (start.noutputs, start.ninputs) != fits or not stability_check(start).holds:
                raise InputError(
                    f"the start must be stable, with {fits[0]} outputs and {fits[1]} inputs; it "
                    f"has {start.noutputs} and {start.ninputs}, and its poles are {start.poles()}"
                )
        for name, value in (("plant", weighted), ("channels", channels), ("start", start)):
            object.__setattr__(self, name, value)

    @cached_property
    def nominal(self) -> GeneralisedPlant:
        """The weighted plant without its uncertainty."""
        return self.plant.nominal()

    def loop(self, controller: StateSpace, *, channel: Channel | None = None) -> GeneralisedPlant:
        """The plant closed by a filter, (perturbation, w) -> (perturbation, z); None: every w."""
        closed = GeneralisedPlant(self.plant.close(controller), self.plant.structure, 0, 0)
        return (
            closed
            if channel is None
            else closed.channel(performance=None, exogenous=list(channel.inputs))
        )

    def certified_peak(self, controller: StateSpace, *, channel: Channel | None = None) -> Peak:
        """The certified peak that a stable filter has in one channel; None: in all together."""
        loop = self.loop(controller, channel=channel)
        band = EVERYWHERE if channel is None else channel.band
        return peak(loop.system, loop.performance_structure, tolerance=PEAK_TOLERANCE, band=band)

    def answer(
        self, controller: StateSpace, *, history: tuple[float, ...] = (), least: float = math.nan
    ) -> FaultFilter | None:
        """A filter with its certified peaks; None if it is not stable."""
        if not stability_check(controller).holds:
            return None
        found = [
            self.certified_peak(controller, channel=channel) for channel in (*self.channels, None)
        ]
        bounds = np.array([[each.lower, each.upper] for each in found])
        return FaultFilter(
            controller, bounds[:-1], bounds[-1], least=least, history=history, proven=tuple(found)
        )

    # --- objective ----------------------------------------------------------------------------

    @property
    def problem_size(self) -> float:
        """Number of states of the weighted plant."""
        return float(self.plant.system.nstates)

    def objective(self, answer: FaultFilter) -> float:
        """The largest proven peak of a requirement over its bound."""
        return answer.upper

    # --- checks -------------------------------------------------------------------------------

    def checks(self, answer: FaultFilter, tolerance: float) -> list[Check]:
        K = answer.K
        fits = (K.noutputs, K.ninputs) == (self.plant.controls, self.plant.measurements)
        statement = "whether K has other outputs and inputs than faults and measurements"
        found = [Check("dimensions", statement, float(not fits), 0.0)]
        if not fits:
            return found
        stability = stability_check(K)
        found.append(replace(stability, name="stable filter", where=""))
        if not stability.holds:
            return found
        claims = (*answer.peaks, answer.stacked)
        proven = answer.proven or (None,) * len(claims)
        for channel, (lower, upper), evidence in zip(
            (*self.channels, None), claims, proven, strict=True
        ):
            name = TOGETHER if channel is None else channel.name
            over = EVERY_PERTURBATION
            if channel is not None and channel.band != EVERYWHERE:
                over = over.replace(EVERY_FREQUENCY, "at every frequency of its band")
            loop = self.loop(K, channel=channel)
            checks = peak_checks(
                loop.system, loop.performance_structure, float(lower), float(upper), evidence
            )
            found += [replace(one, name=f"{name}: {one.name}", over=over) for one in checks]
        if not math.isnan(answer.least):
            found.append(self._least_check(answer))
        return found

    def second_opinion(self, answer: FaultFilter) -> list[Check]:
        found = [loops.powers_fall(answer.K.A, answer.K.dt)]
        claims = (*answer.peaks[:, 1], answer.stacked[1])
        for channel, upper in zip((*self.channels, None), claims, strict=True):
            name = TOGETHER if channel is None else channel.name
            band = EVERYWHERE if channel is None else channel.band
            loop = self.loop(answer.K, channel=channel)
            tried = [loops.gain(loop.system, None, loop.structure, upper, band=band)]
            if band == EVERYWHERE:
                tried += loops.in_time(loop.system, loop.structure, upper)
            found += [replace(check, name=f"{name}: {check.name}") for check in tried]
        return found

    def metrics(self, answer: FaultFilter) -> dict[str, float]:
        return {
            "peak": answer.upper,
            "peak_lower": answer.lower,
            **{
                f"peak_{channel.name}": float(upper)
                for channel, upper in zip(self.channels, answer.peaks[:, 1], strict=True)
            },
            "peak_stacked": float(answer.stacked[1]),
            "least_stacked_nominal": answer.least,
            "order": float(answer.K.nstates),
            "iterations": float(len(answer.history)),
        }

    def _least_check(self, answer: FaultFilter) -> Check:
        """Check of the least norm for the nominal plant, by two Riccati equations."""
        synthesis = HinfSynthesis(self.nominal)
        again, _, said = synthesis.respond("riccati", Context())
        if again is None:
            raise SolverError(f"the least nominal norm is not found again: {said}")
        apart = max(
            relative_excess(answer.least, again.least), relative_excess(again.least, answer.least)
        )
        statement = "distance of the least nominal norm from the one found again, relative"
        return Check("least", statement, apart, LEAST_TOLERANCE, over="for the nominal plant")

    # --- datasets and figures -----------------------------------------------------------------

    def to_dataset(self, answer: FaultFilter) -> Dataset:
        import xarray as xr

        one = {"units": "1"}
        bounds = np.vstack([answer.peaks, answer.stacked])
        return xr.Dataset(
            {
                **stored_system("plant", self.plant.system),
                **stored_system("filter", answer.K),
                "peak": (("requirement", "bound"), bounds, one | {"long_name": "mixed mu"}),
                "least": ((), answer.least, one | {"long_name": "no lower nominal norm was found"}),
                "round_peak": ("round", list(answer.history), one),
                **{
                    key: variable
                    for number, found in enumerate(answer.proven)
                    if found is not None
                    for key, variable in stored_peak(f"proven_{number}", found).items()
                },
            },
            coords={
                "bound": ["lower", "upper"],
                "requirement": [*(channel.name for channel in self.channels), TOGETHER],
            },
        )

    def from_dataset(self, data: Dataset) -> FaultFilter:
        bounds = data["peak"].values
        history = tuple(map(float, data["round_peak"].values))
        least = float(data["least"])
        proven = tuple(
            _of_bounds(restored_peak(data, f"proven_{number}"), *row)
            for number, row in enumerate(bounds.tolist())
        )
        F = restored_system(data, "filter")
        return FaultFilter(F, bounds[:-1], bounds[-1], least=least, history=history, proven=proven)

    def figures(self, answer: FaultFilter) -> dict[str, Figure]:
        loops = []
        for channel in self.channels:
            loop = self.loop(answer.K, channel=channel)
            structure = loop.performance_structure
            loops.append(RequirementLoop(channel.name, loop.system, structure, channel.band))
        return {"channels": channels(loops), "filter": fault_filter(answer.K)}


def _of_bounds(found: Peak | None, lower: float, upper: float) -> Peak | None:
    """A stored peak with the claimed bounds, without its complex part."""
    return found and replace(found, lower=lower, upper=upper, complex_part=0.0)
