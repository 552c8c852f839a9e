"""A plant in coordinates where its entries are near 1, and its controller back in the old ones."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.synthesis.standard import (
    Matrices,
    Real,
    StandardPlant,
    realisation,
    standard_plant,
)
from workbench.uncertainty.generalised import GeneralisedPlant
from workbench.uncertainty.realisation import balancing, frequency_response

Modes = NDArray[np.complex128]
EPS = float(np.finfo(float).eps)
RANK = 1e-10
"""Singular values of D12 and D21 below this share of the largest are zero."""
SINGULAR = 1e12
"""Condition number beyond which a loop has no solution."""
STAIRCASE = (1e-7, 1e-9, 1e-11, 1e-13)
"""Tolerances of the staircase, the first of which that keeps the response is taken."""
KEPT = 1e-9
"""Largest change of the response that a reduction may make, relative to its largest entry."""
SAME = 1e-6
"""Distance up to which a hidden mode is the copy of another one, relative to the largest."""
ROUNDING = 100.0
"""Multiple of the rounding error of a matrix up to which a value counts as zero."""


@dataclass(frozen=True, eq=False)
class Scaled:
    """A continuous plant with D12 = [0; I], D21 = [0 I], D22 = 0, its states and time scaled.

    u = control u_s, y_s = measurement (y - D22 u), t_s = rate t; z_s and w_s are turned only, so
    that the norm is the same. ``given`` is the plant before.
    """

    given: StandardPlant
    plant: StandardPlant
    control: Real
    measurement: Real
    rate: float

    def controller(self, K: Matrices) -> Matrices:
        """A controller of the scaled plant as one of the original plant.

        Raises LinAlgError where the loop through its direct term and D22 is singular.
        """
        A, B, C, D = K
        # K_s (1 + D22 K_s)^-1, in scaled signals, where its condition means something.
        D22 = self.measurement @ self.given.D22 @ self.control
        loop = np.eye(len(D22)) + D22 @ D
        if np.linalg.cond(loop) > SINGULAR:
            raise np.linalg.LinAlgError(
                "the loop through D22 and the direct term of the controller found is singular"
            )
        feedback = np.linalg.solve(loop, np.hstack([D22 @ C, np.eye(len(loop))]))
        through, B_new = np.split(B @ feedback, [len(A)], axis=1)
        direct, D_new = np.split(D @ feedback, [len(A)], axis=1)
        root = math.sqrt(self.rate)
        return (
            self.rate * (A - through),
            root * B_new @ self.measurement,
            root * self.control @ (C - direct),
            self.control @ D_new @ self.measurement,
        )


def scaled(plant: StandardPlant) -> Scaled:
    """Signals normalised, states balanced, hidden states removed, time scaled.

    Raises
    ------
    InputError
        D12 without full column rank or D21 without full row rank; a hidden unstable mode.
    """
    turn_z, control = _normalising(plant.D12, "D12")
    turn_w, measurement = _normalising(plant.D21.T, "D21")
    outputs, inputs = plant.D11.shape
    M = np.block([[plant.B1 @ turn_w, plant.B2 @ control]])
    N = np.block([[turn_z.T @ plant.C1], [measurement.T @ plant.C2]])
    D = np.zeros((outputs + plant.measurements, inputs + plant.controls))
    D[:outputs, :inputs] = turn_z.T @ plant.D11 @ turn_w
    D[outputs - plant.controls : outputs, inputs:] = np.eye(plant.controls)
    D[outputs:, inputs - plant.measurements : inputs] = np.eye(plant.measurements)
    A, B, C = minimal(*balanced(plant.A, M, N))
    A, B, C = balanced(A, B, C)
    rate = speed(A)
    root = math.sqrt(rate)
    A, B, C = A / rate, B / root, C / root
    normal = replace(plant, A=A, B=B, C=C, D=D)
    return Scaled(plant, normal, control, measurement.T, rate)


def _normalising(D12: Real, name: str) -> tuple[Real, Real]:
    """Q orthogonal and S with Q^T D12 S = [0; I]."""
    if not has_rank(D12):
        raise InputError(rank_advice(name, D12))
    # Signals in units far apart would leave the small singular values to rounding.
    sizes = np.linalg.norm(D12, axis=0)
    U, values, Vh = np.linalg.svd(D12 / sizes)
    rank = len(values)
    Q = np.hstack([U[:, rank:], U[:, :rank]])
    return Q, Vh.T / values / sizes[:, None]


def has_rank(D12: Real) -> bool:
    """Whether D12 (outputs, inputs) has full column rank, its columns in any units."""
    rows, columns = D12.shape
    sizes = np.linalg.norm(D12, axis=0)
    if rows < columns or not (sizes > 0.0).all():
        return False
    return bool(np.linalg.svd(D12 / sizes, compute_uv=False)[-1] > RANK)


def rank_advice(name: str, D12: Real) -> str:
    """What a direct term without full rank needs (of D21 the transpose is given)."""
    sizes = np.linalg.norm(D12, axis=0)
    values = np.linalg.svd(D12 / np.where(sizes > 0.0, sizes, 1.0), compute_uv=False)
    rank = int((values > RANK).sum())
    if name == "D12":
        return (
            f"D12 (u -> z) has rank {rank} and must have full column rank {D12.shape[1]}: some "
            "control costs nothing at high frequencies; add a weight on u, or ask regularised()"
        )
    return (
        f"D21 (w -> y) has rank {rank} and must have full row rank {D12.shape[1]}: some "
        "measurement is perfect at high frequencies; add noise on the measurement, or ask "
        "regularised()"
    )


def balanced(A: Real, B: Real, C: Real) -> tuple[Real, Real, Real]:
    """The states in units that bring the entries to one size."""
    factor = state_units(A, B, C)
    return A * factor[:, None] / factor, B * factor[:, None], C / factor


def state_units(A: Real, B: Real, C: Real) -> Real:
    """Factors (n,) of the states that balance a realisation."""
    M = np.block([[A, B], [C, np.zeros((len(C), B.shape[1]))]])
    return balancing(M, len(A))[0][: len(A)]


def speed(A: Real) -> float:
    """A frequency in the middle of the poles other than integrators [rad/s]; 1 without any."""
    size = np.abs(np.linalg.eigvals(A)) if len(A) else np.zeros(0)
    size = size[size > 1e-8 * size.max(initial=0.0)]
    return float(np.exp2(np.round(np.log2(np.median(size))))) if len(size) else 1.0


def minimal(A: Real, B: Real, C: Real, dt: float = 0.0) -> tuple[Real, Real, Real]:
    """A realisation without states that no input reaches or no output shows.

    The response stays the same. Unstable states may go where they are copies of ones that remain,
    as when a system stands in a connection twice.

    Raises
    ------
    InputError
        An unstable hidden mode that is no copy.
    """
    from slycot import tb01pd

    n = len(A)
    if n == 0:
        return A, B, C
    modes = np.linalg.eigvals(A).astype(complex)
    for tolerance in STAIRCASE:
        # SLICOT works in the arrays that it is given.
        width = max(B.shape[1], len(C))
        wide, tall = np.zeros((n, width)), np.zeros((width, n))
        wide[:, : B.shape[1]], tall[: len(C)] = B, C
        a, b, c, r = tb01pd(
            n, B.shape[1], len(C), A.copy(), wide, tall, job="M", equil="N", tol=tolerance
        )
        if r == n:
            return A, B, C
        small = a[:r, :r], b[:r, : B.shape[1]], c[: len(C), :r]
        if _same((A, B, C), small, modes):
            _check_hidden(_unstable(A, dt), small[0])
            return small
    return A, B, C


def visible(plant: GeneralisedPlant) -> GeneralisedPlant:
    """The plant without hidden unstable copies of states; as it is where there are none.

    Raises InputError as `minimal` and `standard_plant`.
    """
    given = standard_plant(plant)
    A, B, C = minimal(*balanced(given.A, given.B, given.C), given.dt)
    if len(_unstable(A, given.dt)) == len(_unstable(given.A, given.dt)):
        return plant
    system = plant.system
    labels = {"inputs": system.input_labels, "outputs": system.output_labels}
    reduced = realisation((A, B, C, given.D), given.dt, **labels)
    return GeneralisedPlant(reduced, plant.structure, plant.controls, plant.measurements)


def _same(one: tuple[Real, Real, Real], other: tuple[Real, Real, Real], modes: Modes) -> bool:
    """Whether realisations agree on a half circle about each mode."""
    size = np.abs(modes)
    radius = np.unique(np.maximum(size, 1e-8 * size.max() + np.finfo(float).tiny))
    radius = np.geomspace(radius[0] / 3, radius[-1] * 3, 12)
    points = np.concatenate([radius * np.exp(0.5j), radius * np.exp(2.0j)])

    def value(A: Real, B: Real, C: Real) -> Real:
        D = np.zeros((len(C), B.shape[1]))
        return frequency_response(np.block([[A, B], [C, D]]), len(A), points)

    expected = value(*one)
    # Each entry is judged against the largest of its input and of its output.
    size = np.abs(expected)
    scale = np.sqrt(size.max(axis=-1, keepdims=True) * size.max(axis=-2, keepdims=True))
    return bool((np.abs(value(*other) - expected) <= KEPT * scale).all())


def _unstable(A: Real, dt: float) -> Modes:
    """Modes on the stability boundary, by rounding, or beyond it."""
    modes = np.linalg.eigvals(A).astype(complex)
    rounding = ROUNDING * EPS * len(A) * float(np.linalg.norm(A))
    return modes[(np.abs(modes) - 1.0 if dt else modes.real) >= -rounding]


def _check_hidden(unstable: Modes, left: Real) -> None:
    """Raise InputError for an unstable mode of which no copy is left."""
    modes = np.linalg.eigvals(left).astype(complex)
    for mode in unstable:
        # Modes that coincide are known to the root of the rounding error.
        if not (np.abs(modes - mode) <= SAME * np.abs(modes).max(initial=0.0)).any():
            raise InputError(
                f"the plant has the unstable mode {mode:.6g}, which no input reaches or no output "
                "shows, so that nothing can stabilise it; take it out of the plant"
            )
