"""True linear plant of each unit near rest, from numerical derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .rig import at_rest, jacobian
from .stranger import Array, Parameters, Stranger

FAR = 1e3
"""Zeros larger than the largest pole by this factor are zeros at infinity that rounding made
finite.
"""


@dataclass(frozen=True)
class LinearPlant:
    """A (n, n), B (n, m) and C (m, n) of a unit near rest, and the dead time of its inputs [s]."""

    A: Array
    B: Array
    C: Array
    delay: float

    def response(self, omega: Array) -> Array:
        """Responses (F, m, m) at angular frequencies [rad/s]."""
        pencil = 1j * omega[:, None, None] * np.eye(len(self.A)) - self.A
        inner = np.linalg.solve(pencil, np.broadcast_to(self.B, (omega.size, *self.B.shape)))
        late = np.exp(-1j * omega * self.delay)
        response: Array = late[:, None, None] * (self.C @ inner)
        return response

    @property
    def poles(self) -> Array:
        """Poles [rad/s]."""
        found: Array = np.linalg.eigvals(self.A)
        return found

    @property
    def zeros(self) -> Array:
        """Finite zeros [rad/s] of a plant with one input and one output."""
        from scipy.linalg import eig

        n = len(self.A)
        scale = np.linalg.norm(self.A)
        system = np.block([[self.A, scale * self.B], [self.C, np.zeros((1, 1))]])
        found = eig(system, np.diag([*np.ones(n), 0.0]), right=False)
        found = found[np.isfinite(found)]
        kept: Array = found[np.abs(found) < FAR * np.abs(self.poles).max()]
        return kept


def linear_plants(plant: Stranger, p: Parameters) -> list[LinearPlant]:
    """The linear plant of each unit at its rest, without dry friction and backlash."""
    x, u = at_rest(plant, p)
    smooth = plant.linear(p)
    if plant.frictionless:
        x, u = at_rest(plant, smooth)
    still = np.zeros(x.shape[1])
    A = jacobian(lambda z: plant.slope(z, u, still, smooth), x)
    B = jacobian(lambda z: plant.slope(x, z, still, smooth), u)
    C = jacobian(lambda z: plant.output(z, smooth), x)
    step = plant.period / plant.substeps
    delay = step * np.round(getattr(p, "delay", still) / step)  # rounded as the rig rounds it
    return [
        LinearPlant(A[:, :, k], B[:, :, k], C[:, :, k], float(delay[k])) for k in range(x.shape[1])
    ]
