"""Discretisation of controllers as well-conditioned realisations with blocks of order two."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from scipy.linalg import expm, schur

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import is_real, need_choice, need_positive
from workbench.solvers import slicot_routine
from workbench.synthesis.implementation.continuation import matched
from workbench.synthesis.implementation.sampled_loop import (
    need_fitting,
    plant_and_sign,
    sampled_conditions,
    what_stabilises,
)
from workbench.systems.balancing import speed, state_units
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import response
from workbench.systems.range_hints import warn_long_period
from workbench.systems.realisation import realisation
from workbench.systems.sampling import held_input_matrices

ImplementationMethod = Literal["tustin", "zoh", "foh"]
"""Discretisation methods for any number of inputs: bilinear transform, and holds of order zero and
one.
"""
DiscretisationMethod = Literal["tustin", "zoh", "foh", "matched"]
"""The same methods, and matched poles and zeros."""
SEPARATION_NORM = 1e3
"""Largest norm of a transformation that separates blocks. Poles that need a larger one stay
together.
"""
CHECKED_NYQUIST_RATIOS = np.logspace(0.0, 4.0, 2000)
"""Frequencies at which the gain of the loop is checked, as multiples of half the sampling rate."""


def discretise(
    controller: Any,
    dt: float,
    *,
    method: DiscretisationMethod = "tustin",
    prewarp: float | None = None,
    plant: Any = None,
    sign: int | None = None,
    delay_samples: float = 0.0,
) -> StateSpace:
    """Discretise a controller with a sampling time [s]; its A becomes block diagonal.

    Each block has a complex pair of poles or a real pole. A block is larger only where poles are so
    close that separate parts would nearly cancel. The blocks are separated in continuous time,
    where slow poles are known to full precision.

    Parameters
    ----------
    controller
        StateSpace or TransferFunction, continuous time.
    method
        ``"tustin"`` is the bilinear transform. ``"zoh"`` is exact for held inputs, and ``"foh"``
        for inputs that are linear between samples. ``"matched"``, for one input and output, has
        poles and zeros exp(s T), all zeros at infinity but one at z = -1, and the same gain at zero
        frequency; its A is a chain of blocks.
    prewarp
        Frequency [rad/s] at which the bilinear transform keeps the response of K.
    plant, sign
        The loop in which K is used, as in `sampled_conditions`. If a plant is given, the sampled
        loop is tested, and K is returned only if the loop is stable.
    delay_samples
        How late the control acts in that loop [samples].

    Raises
    ------
    InputError
        K is sampled; the time is not positive; a prewarp is given with another method or is not
        below half the sampling rate; "matched" is asked of several inputs or outputs; K has a pole
        at 2 / dt; or, with a plant, half the sampling rate is below the loop's bandwidth,
        or the sampled loop is unstable.

    Warns
    -----
    RangeWarning
        The sampling time is above 100 times the longest time constant of K; with a plant, also as
        in `sampled_conditions`.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import discretise
    >>> K = discretise(control.tf([1.0], [1.0, 2.0]), dt=0.1)
    >>> round(float(K.poles()[0].real), 6), K.dt  # (1 - 0.1) / (1 + 0.1)
    (0.818182, 0.1)
    """
    controller = as_system(controller, "controller")
    if controller.dt:
        raise InputError(
            f"controller is sampled already (dt = {controller.dt}); give the continuous controller"
        )
    need_positive(dt, "dt")
    need_choice(method, DiscretisationMethod, "method")
    if plant is not None:
        plant, turn = plant_and_sign(plant, sign)
        need_fitting(controller, plant)
        _check_bandwidth(controller, plant, dt)
    else:
        warn_long_period(dt, controller, "controller")
    A, B, C = block_diagonal(controller.A, controller.B, controller.C)
    D = np.asarray(controller.D, dtype=float)
    if method != "tustin" and prewarp is not None:
        raise InputError(f"prewarp belongs to the bilinear transform; leave it out with {method}")
    if method == "zoh":
        A, B = held_input_matrices(A, B, dt)
    elif method == "foh":
        A, B, D = _linear_between_samples(A, B, C, D, dt)
    elif method == "matched":
        A, B, C, D = matched(controller, dt)
    else:
        half = _half_step(dt, prewarp)
        shifted = np.eye(len(A)) - half * A
        if len(A) and np.linalg.cond(shifted) > 1e12:
            raise InputError(
                f"controller has a pole at 1 / ({half:.6g} s), which the bilinear transform moves "
                "to infinity; take another dt"
            )
        back = np.linalg.inv(shifted)
        root = math.sqrt(2.0 * half)
        D = D + half * C @ back @ B
        A, B, C = back @ (np.eye(len(A)) + half * A), root * back @ B, root * C @ back
    labels = {"inputs": controller.input_labels, "outputs": controller.output_labels}
    sampled = realisation((A, B, C, D), dt, **labels)
    if plant is not None:
        found = sampled_conditions(plant, sampled, dt, delay_samples=delay_samples, sign=turn)
        if not found.stable:
            raise InputError(
                f"the loop sampled every {dt:.6g} s with a delay of {delay_samples:g} samples is "
                f"unstable, its largest pole {found.pole:.6g}; "
                f"{what_stabilises(plant, sampled, dt, delay_samples, turn)}"
            )
    return sampled


def _linear_between_samples(
    A: RealArray, B: RealArray, C: RealArray, D: RealArray, period: float
) -> tuple[RealArray, RealArray, RealArray]:
    """A, B and D for inputs that are linear between samples (G. F. Franklin, J. D. Powell, M. L.
    Workman, Digital Control of Dynamic Systems, 3rd ed., 1997, section 6.3.2: triangle hold).

    With x+ = F x + G1 u + G2 (u+ - u), the state x - G2 u does not need the input of the next
    sample.
    """
    n, m = B.shape
    block = np.zeros((n + 2 * m, n + 2 * m))
    block[:n, :n], block[:n, n : n + m] = A * period, B * period
    block[n : n + m, n + m :] = np.eye(m)
    block = expm(block)
    F, G1, G2 = block[:n, :n], block[:n, n : n + m], block[:n, n + m :]
    return F, G1 + F @ G2 - G2, D + C @ G2


def block_diagonal(
    A: RealArray, B: RealArray, C: RealArray
) -> tuple[RealArray, RealArray, RealArray]:
    """The block diagonal realisation, with blocks of real poles and complex pairs (SLICOT
    MB03RD).
    """
    mb03rd = slicot_routine("mb03rd")

    n = len(A)
    if n == 0:
        return A, B, C
    units = state_units(A, B, C)
    A, B, C = A * units[:, None] / units, B * units[:, None], C / units
    rate = speed(A, B, C)
    T, Q = schur(A / rate)
    blocks, X, sizes, _ = mb03rd(n, T, Q, sort="S", pmax=SEPARATION_NORM)
    B, C = np.linalg.solve(X, B), C @ X
    A = np.zeros((n, n))
    ends = np.cumsum(sizes[sizes > 0])
    for end, size in zip(ends, sizes, strict=False):
        own = slice(int(end - size), int(end))
        A[own, own] = rate * blocks[own, own]
    units = state_units(A, B, C)
    return A * units[:, None] / units, B * units[:, None], C / units


def _half_step(sample_time: float, prewarp: float | None) -> float:
    """The step h [s] of the bilinear transform s = (z - 1) / (h (z + 1))."""
    if prewarp is None:
        return sample_time / 2
    nyquist = math.pi / sample_time
    if not (is_real(prewarp) and 0.0 < prewarp < nyquist):
        raise InputError(
            f"prewarp is {prewarp!r} rad/s; it must lie between 0 and half the sampling rate, "
            f"{nyquist:.6g} rad/s"
        )
    return math.tan(prewarp * sample_time / 2) / prewarp


def _check_bandwidth(K: StateSpace, plant: StateSpace, sample_time: float) -> None:
    """Raise InputError if the continuous loop's gain exceeds 1 above half the sampling rate."""
    nyquist = math.pi / sample_time
    omega = nyquist * CHECKED_NYQUIST_RATIOS
    gain = np.linalg.norm(response(K, omega) @ response(plant, omega), 2, axis=(-2, -1))
    if (gain >= 1.0).any():
        bandwidth = omega[np.flatnonzero(gain >= 1.0)[-1]]
        raise InputError(
            f"dt is {sample_time:.6g} s, half the sampling rate {nyquist:.6g} rad/s; the "
            f"gain of the loop stays above 1 up to {bandwidth:.6g} rad/s or more: dt must "
            f"be well below {math.pi / bandwidth:.3g} s"
        )
