"""A sampled plant, the periodic disturbance inside it and the coloured noise of its measurement."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from workbench.arrays import RealArray
from workbench.diagnosis.estimators.observers import balanced, check_observable
from workbench.diagnosis.estimators.rotation import Rotation
from workbench.errors import InputError
from workbench.heavy_types import StateSpace


@dataclass(frozen=True, eq=False)
class DisturbedPlant:
    """What an estimator of positions and disturbances believes.

    plant     discrete; inputs: the known u and the disturbance; outputs: the measured y and then
              whatever is to be estimated; strictly proper;
    rotation  the disturbance: the sum of the first states of the oscillators;
    colour    discrete, driven by white noise of variance 1, its output added to y; or None;
    beside    discrete, stable, driven by u alone, its outputs estimated too: what moves with u and
              does not show in y; or None.

    The state is (plant, oscillators, colour, beside). Raises InputError when something does not
    fit or an observable part is missing (it names the mode).
    """

    plant: StateSpace
    rotation: Rotation
    colour: StateSpace | None = None
    beside: StateSpace | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.rotation, Rotation):
            raise InputError(f"rotation must be a Rotation, not {type(self.rotation).__name__}")
        for name, system in (
            ("plant", self.plant),
            ("colour", self.colour),
            ("beside", self.beside),
        ):
            if system is not None or name == "plant":
                self._check_system(name, system)
        if self.plant.ninputs != 2:
            raise InputError(
                f"the plant has {self.plant.ninputs} inputs; it needs 2, u and the disturbance"
            )
        if self.colour is not None and (self.colour.ninputs, self.colour.noutputs) != (1, 1):
            raise InputError("the colour of the noise needs one input and one output")
        if self.beside is not None and (
            self.beside.ninputs != 1 or abs(self.beside.poles()).max() >= 1.0
        ):
            raise InputError("the system beside must be stable and have one input, u")
        n = self.seen
        scaled, scale = balanced(self.A[:n, :n])
        check_observable(scaled, self.C[None, :n] * scale, self.period)

    def _check_system(self, name: str, system: Any) -> None:
        import control

        if not isinstance(system, control.StateSpace):
            raise InputError(f"the {name} must be a StateSpace, not {type(system).__name__}")
        if not system.noutputs:
            raise InputError(f"the {name} has no output")
        for part in "ABCD":
            if not np.isfinite(getattr(system, part)).all():
                raise InputError(f"{part} of the {name} has entries that are not finite")
        if not system.isdtime(strict=True) or system.dt is True:
            raise InputError(f"the {name} is continuous or has no sample time; sample it first")
        if not np.isclose(system.dt, self.period):
            raise InputError(
                f"the {name} has the sample time {system.dt} s, the plant {self.period} s"
            )
        if np.any(system.D):
            raise InputError(f"the {name} has a direct feedthrough; it must be strictly proper")

    @property
    def period(self) -> float:
        """Sample time [s]."""
        return float(self.plant.dt)

    @property
    def slices(self) -> tuple[slice, slice, slice, slice]:
        """Where plant, oscillators, colour and what is beside stand in the state."""
        sizes = [self.plant.nstates, 2 * len(self.rotation.harmonics)]
        sizes += [0 if one is None else one.nstates for one in (self.colour, self.beside)]
        ends = accumulate(sizes, initial=0)
        a, b, c, d = (slice(*two) for two in pairwise(ends))
        return a, b, c, d

    @property
    def seen(self) -> int:
        """How many states, the first ones, the measurement shows."""
        return self.slices[2].stop

    @cached_property
    def A(self) -> RealArray:
        """Transition (n, n) at the rotation's own frequency."""
        plant, turning, _, _ = self.slices
        parts = [self.plant.A, self.rotation.oscillators(self.period)]
        parts += [one.A for one in (self.colour, self.beside) if one is not None]
        transition: RealArray = block_diag(*parts)
        transition[plant, turning] = np.outer(self.plant.B[:, 1], self.disturbance[turning])
        return transition

    @cached_property
    def B(self) -> RealArray:
        """Effect of u (n,)."""
        effect = np.zeros(len(self.A))
        effect[self.slices[0]] = self.plant.B[:, 0]
        if self.beside is not None:
            effect[self.slices[3]] = self.beside.B[:, 0]
        return effect

    @cached_property
    def C(self) -> RealArray:
        """Measurement (n,), its coloured noise included."""
        row = np.zeros(len(self.A))
        row[self.slices[0]] = self.plant.C[0]
        if self.colour is not None:
            row[self.slices[2]] = self.colour.C[0]
        return row

    @cached_property
    def Z(self) -> RealArray:
        """What is estimated (z, n): outputs of the plant, y without its noise the first, and of
        what is beside."""
        rows = [self.plant.C, np.zeros((0, self.seen - self.plant.nstates))]
        rows += [] if self.beside is None else [self.beside.C]
        outputs: RealArray = block_diag(*rows)
        return outputs

    @cached_property
    def disturbance(self) -> RealArray:
        """The disturbance (n,): the sum of the first states of the oscillators."""
        row = np.zeros(sum(part.stop - part.start for part in self.slices))
        row[self.slices[1]][::2] = 1.0
        return row


def need_model(model: Any) -> None:
    """Raise InputError where something else is given in a DisturbedPlant's place."""
    if not isinstance(model, DisturbedPlant):
        raise InputError(f"model must be a DisturbedPlant, not {type(model).__name__}")
