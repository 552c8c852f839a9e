"""Generalised plant of fault estimation: weighted disturbances and faults, errors, filter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.input_checks import is_real, need_positive
from workbench.systems.connection import generalised_plant
from workbench.systems.conversion import as_weight, need_plant
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import (
    GeneralisedPlant,
    Signals,
    response,
)

EVERYWHERE = (0.0, math.inf)
"""The band [rad/s] of a requirement that holds at all frequencies."""
TOGETHER = "all together"
"""Name, in results, of all requirements taken together."""
UNSEEN_FAULT_SHARE = 1e-9
"""A fault counts as invisible if its response is below this fraction of the largest fault's
response.
"""


@dataclass(frozen=True, eq=False)
class Requirement:
    """A bound on the error z caused by some disturbances or faults: ||W w -> z|| < bound.

    The norm is that of the map from w to z, where W w are those disturbances or faults.

    Parameters
    ----------
    name
        Its name in results.
    signals
        Names or numbers of the exogenous inputs that the requirement is about.
    weight
        W, stable: a system with one output for each signal; or a number or a system with one
        output, which then weights all signals alike.
    bound
        Largest norm of the error, in units of the fault.
    band
        Lowest and highest frequency [rad/s] at which the requirement must hold.

    Raises InputError for a bound that is not positive, or a band that is not two frequencies.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import Requirement
    >>> weight = control.tf([1.0, 0.1], [1.0, 2.0])
    >>> Requirement("error", "f", weight=weight, bound=0.3, band=(1.0, 100.0)).band
    (1.0, 100.0)
    """

    name: str
    signals: Signals
    _: KW_ONLY
    weight: Any = 1.0
    bound: float = 1.0
    band: tuple[float, float] = EVERYWHERE

    def __post_init__(self) -> None:
        need_positive(self.bound, f"the bound of {self.name!r}")
        if not isinstance(self.name, str):
            raise InputError(f"a requirement's name is {self.name!r}; it must be a string")
        fits = isinstance(self.band, tuple | list) and len(self.band) == 2
        if not (fits and all(map(is_real, self.band)) and 0.0 <= self.band[0] < self.band[1]):
            raise InputError(
                f"the band of {self.name!r} is {self.band}; it must be two frequencies [rad/s], "
                "the lower one first"
            )


def estimation_plant(
    plant: GeneralisedPlant, faults: Signals, requirements: Sequence[Requirement] | None
) -> tuple[GeneralisedPlant, Sequence[Requirement], list[int]]:
    """The weighted plant of a fault estimation, its requirements, and where their inputs begin.

    The plant maps (perturbation, w, u_f) to (perturbation, z, y). Requirement i has the inputs w
    with the numbers ends[i] to ends[i + 1] - 1.

    Raises InputError as `FaultEstimation`.
    """
    _need_filtered(plant)
    f = exogenous_names(plant, faults)
    _need_visible_faults(plant.channel(performance=None, exogenous=f), f)
    d = [name for name in exogenous_names(plant, None) if name not in f]
    if requirements is None:
        requirements = [Requirement("faults", f)]
        requirements += [Requirement("disturbances", d)] if d else []
    _need_requirements(requirements)
    concerned = [exogenous_names(plant, each.signals) for each in requirements]
    if not any(set(names) & set(f) for names in concerned):
        raise InputError(f"no requirement is about the faults {f}: u_f = 0 would meet them all")
    blocks, entering, ends = [], [], [0]
    terms: dict[str, list[str]] = {name: [] for name in exogenous_names(plant, None)}
    for number, (each, names) in enumerate(zip(requirements, concerned, strict=True)):
        weight = as_weight(each.weight, len(names), f"the weight of {each.name!r}") / each.bound
        if not stability_check(weight).holds:
            raise InputError(f"the weight of {each.name!r} is not stable")
        if weight.noutputs != len(names):
            raise InputError(
                f"the weight of {each.name!r} has {weight.noutputs} outputs for {len(names)} "
                f"signals, {names}"
            )
        w = [f"w{number}_{k}" for k in range(weight.ninputs)]
        driven = [f"{name}_{number}" for name in names]
        blocks.append((weight, w, driven))
        entering += w
        ends.append(len(entering))
        for name, signal in zip(names, driven, strict=True):
            terms[name].append(signal)
    used = [name for name, parts in terms.items() if parts]
    kept = plant.channel(performance=None, exogenous=used)
    outs, ins = list(kept.system.output_labels), list(kept.system.input_labels)
    structure = plant.structure or ()
    perturbation = [
        (block, outs[column], ins[row])
        for block, column, row in zip(
            structure,
            plant.structure.column_slices if plant.structure else (),
            plant.structure.row_slices if plant.structure else (),
            strict=True,
        )
    ]
    u, z = [f"u_{name}" for name in f], [f"z_{name}" for name in f]
    sums = {name: " + ".join(terms[name]) for name in used}
    sums |= {error: f"{name} - {guess}" for error, name, guess in zip(z, f, u, strict=True)}
    weighted = generalised_plant(
        [(kept.system, ins, outs), *blocks],
        sums,
        perturbation=perturbation,
        exogenous=entering,
        control=u,
        performance=z,
        measurement=outs[len(outs) - kept.measurements :],
    )
    return weighted, requirements, ends


def _need_requirements(requirements: Any) -> None:
    """Raise InputError unless these are requirements with different names."""
    if not isinstance(requirements, list | tuple):
        raise InputError(f"requirements are {requirements!r}; a list of Requirement is needed")
    for each in requirements:
        if not isinstance(each, Requirement):
            raise InputError(f"{each!r} among the requirements is no Requirement")
    names = [each.name for each in requirements]
    if len({*names, TOGETHER}) <= len(names):
        raise InputError(
            f"requirements are called {names}; every one needs a name of its own, not {TOGETHER!r}"
        )


def exogenous_names(plant: GeneralisedPlant, signals: Signals) -> list[str]:
    """The names of the given exogenous inputs of a plant; None: of all of them."""
    chosen = plant.channel(performance=None, exogenous=signals)
    labels = list(chosen.system.input_labels)
    return labels[len(labels) - chosen.controls - chosen.exogenous : len(labels) - chosen.controls]


def _need_filtered(plant: Any) -> None:
    """Raise InputError for a plant that a filter cannot observe."""
    need_plant(plant)
    if plant.controls or plant.performance or not plant.measurements:
        raise InputError(
            f"the plant has {plant.controls} controls, {plant.performance} performance outputs and "
            f"{plant.measurements} measurements; a filter sits on one without the first two, its "
            "controller closed (GeneralisedPlant.close), and with measurements"
        )
    if plant.system.dt:
        raise InputError(
            f"the plant is sampled at {plant.system.dt} s; fault estimation is in continuous time: "
            "give the plant before it is sampled"
        )
    stability = stability_check(plant.system)
    if not stability.holds:
        raise InputError(
            f"the plant is not stable: it has a pole with real part {stability.value:.3g} "
            f"{stability.where}; close its controller first"
        )


def _need_visible_faults(plant: GeneralisedPlant, faults: list[str]) -> None:
    """Raise InputError if the measurements do not show a fault, or cannot tell faults apart."""
    system = plant.system
    omega = frequencies_of(system)
    measured = response(system, omega)[:, system.noutputs - plant.measurements :, -len(faults) :]
    size = np.abs(measured).max(axis=(0, 1))
    for name, largest in zip(faults, size, strict=True):
        if not largest > UNSEEN_FAULT_SHARE * size.max(initial=0.0):
            raise InputError(f"no measurement shows the fault {name!r}: it cannot be estimated")
    values = np.linalg.svd(measured / size, compute_uv=False)
    if (
        len(faults) > plant.measurements
        or not (values[:, -1] > UNSEEN_FAULT_SHARE * values[:, 0]).any()
    ):
        raise InputError(
            f"the faults {faults} cannot be told from each other by {plant.measurements} "
            "measurements: their responses are linearly dependent at every frequency"
        )
