"""Matrices of the standard plant P = [A B1 B2; C1 D11 D12; C2 D21 D22] of H-infinity synthesis."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.input_checks import need_sampling_time
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import Matrices

LARGEST_ENTRY = 1e100
"""Largest entry that a plant may have, so that its square does not overflow."""
SMALLEST_SIGNAL = 1e-80
"""Least size of the largest entry of an input or output, so that squares of gains do not underflow
to 0.
"""


@dataclass(frozen=True, eq=False)
class StandardPlant:
    """Matrices of a plant with inputs (w, u) and outputs (z, y).

    Unlike a `GeneralisedPlant`, it has no names and no structure: it splits arrays into the
    blocks of the Riccati equations.

    u are the last `controls` inputs and y the last `measurements` outputs. ``dt`` is the sampling
    time [s], 0 in continuous time.
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
        """The transposed plant: its control problem is the estimation problem of this one."""
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
        """The closed loop F_l(P, K) with every state of P and K.

        Raises LinAlgError if I - D22 D_K is singular.
        """
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
    """The standard plant of a generalised plant.

    Perturbation inputs count as exogenous inputs, and perturbation outputs as performance outputs.

    Raises
    ------
    InputError
        The plant has entries that are not finite or too large, or signals that are too small;
        lacks exogenous inputs, performance outputs, controls or measurements; or is sampled at a
        time that is not given.
    """
    system = plant.system
    A, B, C, D = (np.asarray(getattr(system, name), dtype=float) for name in "ABCD")
    for name, part in zip("ABCD", (A, B, C, D), strict=True):
        if not np.isfinite(part).all():
            raise InputError(f"{name} of the plant has entries that are not finite")
        size = float(np.abs(part).max(initial=0.0))
        if size > LARGEST_ENTRY:
            raise InputError(
                f"{name} of the plant has an entry of size {size:.3g}, whose square overflows; "
                "give time and signals in units that bring it nearer to 1"
            )
    columns, rows = np.vstack([B, D]), np.hstack([C, D])
    for kind, sizes in (
        ("input", np.abs(columns).max(axis=0, initial=0.0)),
        ("output", np.abs(rows).max(axis=1, initial=0.0)),
    ):
        for place in np.flatnonzero((sizes > 0.0) & (sizes < SMALLEST_SIGNAL)):
            raise InputError(
                f"{kind} {place + 1} of the plant has no entry larger than {sizes[place]:.3g}, "
                "whose square is 0 in floating point; give signals in units that bring it nearer "
                "to 1"
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
    need_sampling_time(dt, "the plant")
    if not np.isfinite(dt or 0.0):
        raise InputError(f"the plant has a sampling time of {dt}; give it in seconds")
    return StandardPlant(A, B, C, D, plant.controls, plant.measurements, float(dt or 0.0))
