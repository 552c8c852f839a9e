"""A sampled plant, the periodic disturbance inside it and the coloured noise of its measurement."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.diagnosis.estimators.observers import balanced_matrix, check_observable
from workbench.diagnosis.estimators.rotation import Rotation
from workbench.errors import InputError
from workbench.input_checks import need_sampling_time


@dataclass(frozen=True, eq=False)
class DisturbedPlant:
    """The model on which an estimator of positions and disturbances is based.

    Unlike a `StateSpace`, it keeps plant, disturbance and noise apart, because an estimator
    needs each of them.

    plant     discrete and strictly proper; inputs: the known u and the disturbance; outputs: the
              measured y, then the other outputs to be estimated;
    rotation  the disturbance: the sum of the first states of the oscillators;
    colour    discrete, driven by white noise of variance 1, its output added to y; or None;
    unmeasured  discrete and stable, driven by u alone, for motions that u causes but do not show in
              y; its outputs are estimated too; or None.

    The state is (plant, oscillators, colour, unmeasured). Raises InputError if something does not
    fit, or if a mode does not show in y; the message names the mode.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import DisturbedPlant, Rotation
    >>> from workbench.simulation import sampled_model
    >>> A, B = [[0.0, 1.0], [-400.0, -25.0]], [[0.0, 0.0], [400.0, 400.0]]
    >>> lens = control.ss(A, B, [[1.0, 0.0]], 0.0)
    >>> model = DisturbedPlant(sampled_model(lens, 1e-3), Rotation(frequency_hz=5.0))
    >>> model.dt, model.seen  # two states of the lens and two of the oscillator
    (0.001, 4)
    """

    plant: StateSpace
    rotation: Rotation
    _: KW_ONLY
    colour: StateSpace | None = None
    unmeasured: StateSpace | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.rotation, Rotation):
            raise InputError(f"rotation must be a Rotation, not {type(self.rotation).__name__}")
        for name, system in (
            ("plant", self.plant),
            ("colour", self.colour),
            ("unmeasured", self.unmeasured),
        ):
            if system is not None or name == "plant":
                self._check_system(name, system)
        if self.plant.ninputs != 2:
            raise InputError(
                f"the plant has {self.plant.ninputs} inputs; it needs 2, u and the disturbance"
            )
        if self.colour is not None and (self.colour.ninputs, self.colour.noutputs) != (1, 1):
            raise InputError("the colour of the noise needs one input and one output")
        if self.unmeasured is not None and (
            self.unmeasured.ninputs != 1 or abs(self.unmeasured.poles()).max() >= 1.0
        ):
            raise InputError("the unmeasured system must be stable and have one input, u")
        n = self.seen
        scaled, scale = balanced_matrix(self.A[:n, :n])
        check_observable(scaled, self.C[None, :n] * scale, self.dt)

    def _check_system(self, name: str, system: Any) -> None:
        import control

        if not isinstance(system, control.StateSpace):
            raise InputError(f"the {name} must be a StateSpace, not {type(system).__name__}")
        if not system.noutputs:
            raise InputError(f"the {name} has no output")
        for part in "ABCD":
            if not np.isfinite(getattr(system, part)).all():
                raise InputError(f"{part} of the {name} has entries that are not finite")
        if not system.isdtime(strict=True):
            raise InputError(f"the {name} is continuous; sample it first")
        need_sampling_time(system.dt, f"the {name}")
        if not np.isclose(system.dt, self.dt):
            raise InputError(f"the {name} has the sample time {system.dt} s, the plant {self.dt} s")
        if np.any(system.D):
            raise InputError(f"the {name} has a direct feedthrough; it must be strictly proper")

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return float(self.plant.dt)

    @property
    def slices(self) -> tuple[slice, slice, slice, slice]:
        """Slices of the state: plant, oscillators, colour, and the unmeasured system."""
        sizes = [self.plant.nstates, 2 * len(self.rotation.harmonics)]
        sizes += [0 if one is None else one.nstates for one in (self.colour, self.unmeasured)]
        ends = accumulate(sizes, initial=0)
        a, b, c, d = (slice(*two) for two in pairwise(ends))
        return a, b, c, d

    @property
    def seen(self) -> int:
        """Number of states that the measurement shows; they come first."""
        return self.slices[2].stop

    @cached_property
    def A(self) -> RealArray:
        """The transition matrix (n, n) over a sample, at the rotation's own frequency."""
        plant, turning, _, _ = self.slices
        parts = [self.plant.A, self.rotation.oscillators(self.dt)]
        parts += [one.A for one in (self.colour, self.unmeasured) if one is not None]
        transition: RealArray = block_diag(*parts)
        transition[plant, turning] = np.outer(self.plant.B[:, 1], self.disturbance[turning])
        return transition

    @cached_property
    def B(self) -> RealArray:
        """The effect (n,) of u on the next state."""
        effect = np.zeros(len(self.A))
        effect[self.slices[0]] = self.plant.B[:, 0]
        if self.unmeasured is not None:
            effect[self.slices[3]] = self.unmeasured.B[:, 0]
        return effect

    @cached_property
    def C(self) -> RealArray:
        """The row (n,) that gives the measurement, its coloured noise included."""
        row = np.zeros(len(self.A))
        row[self.slices[0]] = self.plant.C[0]
        if self.colour is not None:
            row[self.slices[2]] = self.colour.C[0]
        return row

    @cached_property
    def Z(self) -> RealArray:
        """The rows (z, n) that give the estimated outputs.

        The outputs of the plant come first, beginning with y without its noise; then those of
        `unmeasured`.
        """
        rows = [self.plant.C, np.zeros((0, self.seen - self.plant.nstates))]
        rows += [] if self.unmeasured is None else [self.unmeasured.C]
        outputs: RealArray = block_diag(*rows)
        return outputs

    @cached_property
    def disturbance(self) -> RealArray:
        """The row (n,) that gives the disturbance: the sum of the oscillators' first states."""
        row = np.zeros(sum(part.stop - part.start for part in self.slices))
        row[self.slices[1]][::2] = 1.0
        return row


def need_model(model: Any) -> None:
    """Raise InputError unless the model is a DisturbedPlant."""
    if not isinstance(model, DisturbedPlant):
        raise InputError(f"model must be a DisturbedPlant, not {type(model).__name__}")
