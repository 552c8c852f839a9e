"""Destabilising perturbations as stable real systems, no larger than 1 / mu.

Let (I - M(j w0) Delta) z = 0. A system Delta(s) destabilises the loop if Delta(j w0) z = Delta z.
Any phase is the value at j w0 of an all-pass (s - a) / (s + a) or of its negative. A complex scalar
is realised as its size times one all-pass. With w = Delta z, a full block is realised as the dyad
|w| / |z| alpha(s) beta(s)^T, whose entries are the sizes of those of w / |w| and of conj(z) / |z|,
each times one all-pass; so |alpha(j w)| = |beta(j w)| = 1 at every w.

Source: K. Zhou, J. Doyle, K. Glover, Robust and Optimal Control (1996), theorem 9.1 (small gain).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench._core.arrays import Array
from workbench.certify.balls import in_plane
from workbench.certify.perturbed_loop import proven_at, proven_over_frequency, sharp_response
from workbench.certify.stable_system import StableSystem
from workbench.errors import InputError
from workbench.mu.frequency.attained import PROVEN_SHARE
from workbench.mu.frequency.peak_bounds import Peak
from workbench.mu.frequency.sweep import fitting
from workbench.mu.robust.skew import LARGEST_LOOP_CONDITION
from workbench.structure import Full, Real, Structure
from workbench.systems.bilinear import bilinear_sampled

END_OFFSET = 1e-6
"""Where the peak is at frequency 0, a complex Delta is interpolated at this multiple of the slowest
pole instead; at infinity, at the fastest pole divided by this. There the response differs from its
limit by 1e-6. With half of it the interpolation has fewer digits; with double of it Delta moves by
2e-6.
"""
REAL_TOLERANCE, NEARLY_REAL_TOLERANCE = 1e-12, 1e-6
"""A value counts as real if its imaginary part is below the first share of it; a vector is replaced
by its real part if its imaginary part is below the second share. The first is the rounding of an
eigenvalue; the second, of a null vector at a peak known to six digits. Half or double decides the
same.
"""
DESTABILISING_TOLERANCE = 1e-6
"""A null vector of I - M Delta, balanced, is interpolated if its singular value is below this share
of the norm of M Delta or of 1, whichever is larger. The Delta of this peak leaves rounding, that of
another system about 1. Half or double decides the same.
"""
LARGEST_EIGENVALUE_SHIFT = 0.1
"""Largest distance from 1 of the loop's eigenvalue at the frequency used instead of 0 or infinity.
At `END_OFFSET` it moves by 1e-6 times the slope; a tenth says that the eigenvalue is another one.
Half or double decides the same.
"""


def destabilising_perturbation(peak: Peak, system: Any, structure: Structure) -> Any:
    """The perturbation of a peak's lower bound as a stable system with real coefficients.

    With this perturbation in positive feedback, the system has poles at +-j peak.omega, a sampled
    one at exp(+-j peak.omega T); where peak.omega is infinite, the loop is not well posed.

    Parameters
    ----------
    peak
        Result of `peak(system, structure)` with a positive lower bound.
    system
        The system of the peak: a StateSpace or TransferFunction with c outputs and r inputs.
    structure
        Blocks of Delta, the same as for the peak.

    Returns
    -------
    control.StateSpace
        System with r outputs and c inputs. Real blocks are constant, complex scalars have one state
        for each repetition, and full blocks have at most outputs + inputs - 1 states. The
        H-infinity norm is 1 / peak.lower, or less where a full block of the peak's Delta is larger
        than its gain for z.

        If the peak has a complex part, each real block is a constant of at most 1 / peak.lower
        plus an all-pass of at most complex_part / peak.lower; the norm may be larger by as much.

        At 0 and at infinity a real system has a real value. Where Delta is complex there, it is
        interpolated at 1e-6 times the slowest pole or 1e6 times the fastest pole instead. Its
        complex blocks, and thereby the norm, are multiplied by the number near 1 that makes the
        loop singular there.

    Raises
    ------
    InputError
        The lower bound is 0; Delta is not proven to destabilise this system; or, at 0 or
        infinity, the complex blocks of a complex Delta have no influence on the singularity.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import destabilising_perturbation, peak
    >>> from workbench.structure import Complex, Structure
    >>> system = control.ss(control.tf([0.5], [1.0, 0.2, 1.0]))
    >>> structure = Structure([Complex(1)])
    >>> found = peak(system, structure)
    >>> Delta = destabilising_perturbation(found, system, structure)
    >>> poles = control.feedback(system, Delta, sign=1).poles()
    >>> bool(abs(poles.real).min() < 1e-6), round(float(1 / found.lower), 3)
    (True, 0.398)
    """
    if not isinstance(peak, Peak):
        raise InputError(
            f"peak must be a result of `peak(system, structure)`, not {type(peak).__name__}"
        )
    if not peak.lower > 0:
        raise InputError("the peak's lower bound is 0: no destabilising perturbation is known")
    stable = fitting(system, structure, sampled=True)
    Delta = np.asarray(peak.Delta)
    if Delta.shape != (structure.rows, structure.columns):
        raise InputError(
            f"the peak has a Delta of shape {Delta.shape}; the structure {structure.to_pairs()} "
            f"needs ({structure.rows}, {structure.columns})"
        )
    allowed = structure.complexified() if peak.complex_part else structure
    if not allowed.contains(Delta):
        raise InputError(f"the peak's Delta has not the structure {structure.to_pairs()}")
    omega = stable.plane(peak.omega)
    constant = _constants(Delta, structure, 1 / peak.lower)
    proven = proven_at(stable, allowed, Delta, in_plane(peak.omega, stable.period))
    if not proven >= (wanted := PROVEN_SHARE / float(np.linalg.norm(Delta, 2))):
        proven = max(proven, proven_over_frequency(stable, allowed, Delta))
    if not proven >= wanted:
        raise InputError(
            f"the Delta of the peak, at {peak.omega:.6g} rad/s, is not proven to destabilise the "
            f"loop of this system: it proves mu to be at least {proven:.6g}, and {wanted:.6g} is "
            "needed; the peak must be that of this system and this structure"
        )
    M = _response(stable, omega)
    z = null_vector(M, Delta)
    if not 0.0 < omega < math.inf:
        real = _made_real(Delta, z, structure)
        if real is None:
            omega = _nearby_frequency(stable, omega)
            M = _response(stable, omega)
        Delta = constant + _attained(M, constant, (Delta if real is None else real) - constant)
        z = null_vector(M, Delta)
    made = interpolated(Delta, z, structure, omega, constant)
    return bilinear_sampled(made, stable.period) if stable.period else made


def interpolated(
    Delta: Array, z: Array, structure: Structure, omega: float, constant: Array
) -> Any:
    """A stable system that maps z to Delta z at a frequency [rad/s], no larger than Delta.

    ``constant`` are the real parts of Delta that are the same at every frequency.
    """
    import control

    w, parts = Delta @ z, []
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        if isinstance(block, Full):
            parts.append(_dyad(w[row], z[column], omega))
        else:
            fixed = constant[row, column]
            parts.append(scalars_at(np.diagonal(Delta[row, column] - fixed), omega) + fixed)
    return control.append(*parts)


def _response(stable: StableSystem, omega: float) -> Array:
    """The response at a frequency, in ball arithmetic where that is sharp."""
    sharp = sharp_response(stable, omega)
    return stable.response([omega])[0] if sharp is None else sharp


def _constants(Delta: Array, structure: Structure, radius: float) -> Array:
    """The real parts of Delta's real blocks, limited to a radius; zero elsewhere."""
    constant = np.zeros(Delta.shape)
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        if isinstance(block, Real):
            constant[row, column] = np.clip(Delta[row, column].real, -radius, radius)
    return constant


def null_vector(M: Array, Delta: Array) -> Array:
    """The unit z with (I - M Delta) z = 0, turned by the common phase that makes it most real."""
    from scipy.linalg import matrix_balance

    product = M @ Delta
    if not product.imag.any():
        product = product.real
    loop, frame = matrix_balance(product, permute=False)
    _, values, Vh = np.linalg.svd(np.eye(len(loop)) - loop)
    if values[-1] > DESTABILISING_TOLERANCE * max(1.0, float(np.linalg.norm(loop, 2))):
        raise InputError(
            f"I - M Delta at the peak's frequency has the singular value {values[-1]:.3g}; the "
            "peak must be that of this system and this structure"
        )
    z = frame @ Vh[-1].conj()
    z = z * np.exp(-0.5j * np.angle(np.sum(z**2)))
    return z / np.linalg.norm(z)


def _made_real(Delta: Array, z: Array, structure: Structure) -> Array | None:
    """A real Delta that maps z as Delta does, where z and Delta z are nearly real; else None.

    M is real at frequencies 0 and infinity, so the real parts of z and Delta z solve the same
    equations as z and Delta z.
    """
    w = Delta @ z
    if any(np.abs(v.imag).max() > NEARLY_REAL_TOLERANCE * np.abs(v).max() for v in (z, w)):
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


def _nearby_frequency(system: StableSystem, omega: float) -> float:
    """A frequency [rad/s] at which the response is nearly that at `omega`, which is 0 or
    infinity.
    """
    poles = np.abs(system.poles) if len(system.poles) else np.ones(1)
    return float(END_OFFSET * poles.min() if omega == 0.0 else poles.max() / END_OFFSET)


def _attained(M: Array, constant: Array, free: Array) -> Array:
    """The free part of Delta times the number near 1 that makes the loop singular."""
    loop = np.eye(len(M)) - M @ constant
    # the constant blocks alone make it singular
    if not free.any() or np.linalg.cond(loop) > LARGEST_LOOP_CONDITION:
        return free
    seen = np.linalg.solve(loop, M) @ free
    values = np.linalg.eigvals(seen)
    value = values[np.argmin(np.abs(values - 1))]
    if not np.abs(value - 1) < LARGEST_EIGENVALUE_SHIFT:
        raise InputError(
            "the peak lies at frequency 0 or infinity with a complex Delta, which no real system "
            "has there, and at a nearby frequency no Delta close to it makes the loop singular"
        )
    scaled: Array = free / value
    return scaled


def _dyad(w: Array, z: Array, omega: float) -> Any:
    """A system D (r, c) with D(j omega) z = w and gain at most |w| / |z| at every frequency."""
    import control

    size, length = np.linalg.norm(w), np.linalg.norm(z)
    if size == 0.0:  # the zero system suffices
        return control.ss([], [], [], np.zeros((len(w), len(z))))
    # A common phase makes the largest entry real, which saves one state.
    phase = np.exp(1j * np.angle(w[np.argmax(np.abs(w))]))
    alpha, beta = scalars_at(w / size / phase, omega), scalars_at(z.conj() / length * phase, omega)
    return alpha * (size / length * np.ones((len(w), len(z)))) * beta


def scalars_at(values: Array, omega: float) -> Any:
    """The diagonal system with these values (n,) at omega and constant gains at all frequencies."""
    import control

    turning = np.abs(values.imag) > REAL_TOLERANCE * np.abs(values)
    gain = np.where(turning, np.abs(values) * np.sign(values.imag), values.real)
    angle = np.angle(values[turning] / gain[turning])
    a = omega * np.tan(angle / 2)
    select = np.eye(len(values))[:, turning] * np.sqrt(2 * a)
    return control.ss(-np.diag(a), select.T, -gain[:, None] * select, np.diag(gain))
