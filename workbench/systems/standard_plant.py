"""The standard plant P = [A B1 B2; C1 D11 D12; C2 D21 D22] of H-infinity synthesis, as matrices."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from workbench.errors import InputError
from workbench.systems.generalised_plant import GeneralisedPlant

if TYPE_CHECKING:
    pass
from workbench.arrays import RealArray
from workbench.systems.realisation import Matrices

LARGEST = 1e100
"""Of entries of a plant."""


@dataclass(frozen=True, eq=False)
class StandardPlant:
    """Inputs (w, u) with u the last `controls`, outputs (z, y) with y the last `measurements`.

    ``dt`` is the sampling time [s], 0 in continuous time.
    """

    A: RealArray
    B: RealArray
    C: RealArray
    D: RealArray
    controls: int
    measurements: int
    dt: float = 0.0

    @property
    def states(self) -> int:
        return len(self.A)

    @property
    def B1(self) -> RealArray:
        return self.B[:, : self._w]

    @property
    def B2(self) -> RealArray:
        return self.B[:, self._w :]

    @property
    def C1(self) -> RealArray:
        return self.C[: self._z]

    @property
    def C2(self) -> RealArray:
        return self.C[self._z :]

    @property
    def D11(self) -> RealArray:
        return self.D[: self._z, : self._w]

    @property
    def D12(self) -> RealArray:
        return self.D[: self._z, self._w :]

    @property
    def D21(self) -> RealArray:
        return self.D[self._z :, : self._w]

    @property
    def D22(self) -> RealArray:
        return self.D[self._z :, self._w :]

    @property
    def _w(self) -> int:
        return self.D.shape[1] - self.controls

    @property
    def _z(self) -> int:
        return self.D.shape[0] - self.measurements

    @property
    def dual(self) -> StandardPlant:
        """The transposed plant, in which estimation is control."""
        return replace(
            self,
            A=self.A.T,
            B=self.C.T,
            C=self.B.T,
            D=self.D.T,
            controls=self.measurements,
            measurements=self.controls,
        )

    def close(self, K: Matrices) -> Matrices:
        """F_l(P, K) with every state; raises LinAlgError where I - D22 D_K is singular."""
        Ak, Bk, Ck, Dk = K
        # u = Ck xk + Dk y with y = C2 x + D21 w + D22 u
        inside = np.linalg.solve(
            np.eye(self.measurements) - self.D22 @ Dk,
            np.hstack([self.C2, self.D22 @ Ck, self.D21]),
        )
        outside = Dk @ inside
        n, k = self.states, len(Ak)
        outside[:, n : n + k] += Ck
        M = np.vstack([self.B2 @ outside, Bk @ inside, self.D12 @ outside])
        M[:n, :n] += self.A
        M[:n, n + k :] += self.B1
        M[n : n + k, n : n + k] += Ak
        M[n + k :, :n] += self.C1
        M[n + k :, n + k :] += self.D11
        return M[: n + k, : n + k], M[: n + k, n + k :], M[n + k :, : n + k], M[n + k :, n + k :]


def standard_plant(plant: GeneralisedPlant) -> StandardPlant:
    """Its matrices; perturbation channels count as exogenous and performance.

    Raises
    ------
    InputError
        Entries that are not finite, or too large; no exogenous input, performance, control or
        measurement.
    """
    system = plant.system
    A, B, C, D = (np.asarray(getattr(system, name), dtype=float) for name in "ABCD")
    for name, part in zip("ABCD", (A, B, C, D), strict=True):
        if not np.isfinite(part).all():
            raise InputError(f"{name} of the plant has entries that are not finite")
        size = float(np.abs(part).max(initial=0.0))
        if size > LARGEST:
            raise InputError(
                f"{name} of the plant has an entry of size {size:.3g}, whose square overflows; "
                "give time and signals in units that bring it nearer to 1"
            )
    counts = {
        "controls": plant.controls,
        "measurements": plant.measurements,
        "exogenous inputs": system.ninputs - plant.controls,
        "performance outputs": system.noutputs - plant.measurements,
    }
    for name, count in counts.items():
        if count < 1:
            raise InputError(
                f"the plant has {system.ninputs} inputs, {system.noutputs} outputs and no {name}; "
                "synthesis needs at least one each of w, z, u and y"
            )
    dt = system.dt
    if dt is True:
        raise InputError("the plant is sampled at a time not given (dt True); give it in seconds")
    return StandardPlant(A, B, C, D, plant.controls, plant.measurements, float(dt or 0.0))
