"""A destabilising perturbation as a system: real, stable, and no larger than mu says.

Given z with (I - M(j w0) Delta) z = 0 it suffices that Delta(j w0) z = w = Delta z. A phase is the
value at j w0 of an all-pass (s - a) / (s + a) or its negative, so that a complex scalar is its size
times one all-pass, and a full block the dyad |w| / |z| alpha(s) beta(s)^T whose entries are sizes
of w / |w| and of conj(z) / |z| times one all-pass each: |alpha(j w)| = |beta(j w)| = 1 at every w.

Source: K. Zhou, J. Doyle, K. Glover, Robust and Optimal Control (1996), theorem 9.1 (small gain).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.certify.interval import StableSystem
from workbench.errors import InputError
from workbench.mu.frequency.peak import Peak
from workbench.mu.frequency.sweep import fitting
from workbench.structure import Full, Real, Structure

BESIDE = 1e-6
"""How far from an end of the axis, relative to the poles, a complex Delta is interpolated."""
REAL, NEARLY = 1e-12, 1e-6
"""Imaginary part, relative, that counts as none, and that which can be made none."""
SINGULAR = 1e-6
"""Smallest singular value of I - M Delta, balanced, relative to M Delta, that counts as 0."""
REGULAR = 1e10
"""Condition number of I - M Delta, Delta its real blocks only, up to which others are needed."""
NEAR = 0.1
"""How far from 1 an eigenvalue may move from the end of the axis to beside it."""


def destabilising(peak: Peak, system: Any, structure: Structure) -> Any:
    """The perturbation of a peak's lower bound as a stable system with real coefficients.

    Closed by it in positive feedback, the system has a pole at
    +-j peak.omega, or is not well posed where that is infinite.

    Parameters
    ----------
    peak
        As `peak(system, structure)` gives it, its lower bound positive.
    system
        StateSpace or TransferFunction (c outputs, r inputs), the one of the peak.
    structure
        Blocks of Delta, those of the peak.

    Returns
    -------
    control.StateSpace
        (r outputs, c inputs). Real blocks are constant, complex scalars have one state for each
        repetition, full blocks at most outputs + inputs - 1. The H-infinity norm is 1 / peak.lower,
        or less where full blocks are larger than what they do to z.

        With a complex part of the peak, real blocks are a constant of at most 1 / peak.lower and an
        all-pass of at most complex_part / peak.lower: as much is allowed to the norm.

        At 0 and at infinity a real system has a real value. Where Delta is complex there, it is
        interpolated at a frequency 1e-6 of the slowest pole or 1e6 of the fastest, with its
        complex blocks multiplied by the number near 1 that this takes; the norm follows.

    Raises
    ------
    InputError
        A lower bound of 0; a Delta that does not make this system's loop singular; at 0 or
        infinity, a complex Delta whose complex blocks have no part in the singularity nearby.
    """
    import control

    if not isinstance(peak, Peak):
        raise InputError(
            f"peak must be what `peak(system, structure)` gives, not {type(peak).__name__}"
        )
    if not peak.lower > 0:
        raise InputError("the peak's lower bound is 0: no destabilising perturbation is known")
    stable = fitting(system, structure)
    Delta = np.asarray(peak.Delta)
    if Delta.shape != (structure.rows, structure.columns):
        raise InputError(
            f"the peak has a Delta of shape {Delta.shape}; the structure {structure.to_pairs()} "
            f"needs ({structure.rows}, {structure.columns})"
        )
    allowed = structure.complexified() if peak.complex_part else structure
    if not allowed.contains(Delta):
        raise InputError(f"the peak's Delta has not the structure {structure.to_pairs()}")
    omega = peak.omega
    constant = _constants(Delta, structure, 1 / peak.lower)
    M = stable.response([omega])[0]
    z = _null(M, Delta)
    if not 0.0 < omega < math.inf:
        real = _made_real(Delta, z, structure)
        if real is None:
            omega = _beside(stable, omega)
            M = stable.response([omega])[0]
        Delta = constant + _attained(M, constant, (Delta if real is None else real) - constant)
        z = _null(M, Delta)
    w = Delta @ z
    parts = []
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        if isinstance(block, Full):
            parts.append(_dyad(w[row], z[column], omega))
        else:
            fixed = constant[row, column]
            parts.append(_turns(np.diagonal(Delta[row, column] - fixed), omega) + fixed)
    return control.append(*parts)


def _constants(Delta: Array, structure: Structure, radius: float) -> Array:
    """Of Delta, the real part of its real blocks as far as their radius allows."""
    constant = np.zeros(Delta.shape)
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        if isinstance(block, Real):
            constant[row, column] = np.clip(Delta[row, column].real, -radius, radius)
    return constant


def _null(M: Array, Delta: Array) -> Array:
    """The unit z with (I - M Delta) z = 0, its common phase the one that makes it most real."""
    from scipy.linalg import matrix_balance

    product = M @ Delta
    if not product.imag.any():
        product = product.real
    loop, frame = matrix_balance(product, permute=False)
    _, values, Vh = np.linalg.svd(np.eye(len(loop)) - loop)
    if values[-1] > SINGULAR * max(1.0, float(np.linalg.norm(loop, 2))):
        raise InputError(
            f"I - M Delta at the peak's frequency has the singular value {values[-1]:.3g}; the "
            "peak must be that of this system and this structure"
        )
    z = frame @ Vh[-1].conj()
    z = z * np.exp(-0.5j * np.angle(np.sum(z**2)))
    return z / np.linalg.norm(z)


def _made_real(Delta: Array, z: Array, structure: Structure) -> Array | None:
    """A real Delta that does what Delta does to a z that is nearly real; None for another z.

    M is real at the ends of the axis, so that with z and Delta z their real parts solve the same
    equations.
    """
    w = Delta @ z
    if any(np.abs(v.imag).max() > NEARLY * np.abs(v).max() for v in (z, w)):
        return None
    blocks = []
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        length = np.sum(z[column].real ** 2)
        if isinstance(block, Full):
            dyad = np.outer(w[row].real, z[column].real)
            blocks.append(dyad / length if length > 0 else np.zeros_like(dyad))
        else:
            blocks.append(Delta[row, column].real)
    return structure.diagonal(blocks)


def _beside(system: StableSystem, omega: float) -> float:
    """A frequency [rad/s] where a system is nearly what it is at the end `omega` of the axis."""
    poles = np.abs(system.poles) if len(system.poles) else np.ones(1)
    return float(BESIDE * poles.min() if omega == 0.0 else poles.max() / BESIDE)


def _attained(M: Array, constant: Array, free: Array) -> Array:
    """The free part of Delta times the number near 1 with which it makes the loop singular."""
    loop = np.eye(len(M)) - M @ constant
    if not free.any() or np.linalg.cond(loop) > REGULAR:  # the constants do it alone
        return free
    seen = np.linalg.solve(loop, M) @ free
    values = np.linalg.eigvals(seen)
    value = values[np.argmin(np.abs(values - 1))]
    if not np.abs(value - 1) < NEAR:
        raise InputError(
            "the peak lies at an end of the frequency axis with a complex Delta, which no real "
            "system has there, and beside it nothing near that Delta makes the loop singular"
        )
    scaled: Array = free / value
    return scaled


def _dyad(w: Array, z: Array, omega: float) -> Any:
    """A system D (r, c) with D(j omega) z = w and D D^H <= |w|^2 / |z|^2 everywhere."""
    import control

    size, length = np.linalg.norm(w), np.linalg.norm(z)
    if size == 0.0:  # it need not do anything
        return control.ss([], [], [], np.zeros((len(w), len(z))))
    # The largest entry is made real by a common phase: one state less.
    phase = np.exp(1j * np.angle(w[np.argmax(np.abs(w))]))
    alpha, beta = _turns(w / size / phase, omega), _turns(z.conj() / length * phase, omega)
    return alpha * (size / length * np.ones((len(w), len(z)))) * beta


def _turns(values: Array, omega: float) -> Any:
    """The diagonal system with these values (n,) at omega and their sizes at all frequencies."""
    import control

    turning = np.abs(values.imag) > REAL * np.abs(values)
    gain = np.where(turning, np.abs(values) * np.sign(values.imag), values.real)
    angle = np.angle(values[turning] / gain[turning])
    a = omega * np.tan(angle / 2)
    select = np.eye(len(values))[:, turning] * np.sqrt(2 * a)
    return control.ss(-np.diag(a), select.T, -gain[:, None] * select, np.diag(gain))
