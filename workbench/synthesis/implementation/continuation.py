"""Matched poles and zeros from continuous to sampled time and back; continuous systems from sampled
ones.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from scipy.linalg import logm

from workbench._core.arrays import ComplexArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import need_choice, need_sampling_time
from workbench.systems.axis_poles import pole_may_be_at
from workbench.systems.balancing import state_units
from workbench.systems.bilinear import bilinear_continuous
from workbench.systems.conversion import as_system
from workbench.systems.realisation import Matrices, in_series, realisation

ContinuationMethod = Literal["zoh", "tustin", "matched"]
"""Ways back to continuous time: from a hold, a bilinear transform, or matched poles and zeros."""
AT_ZERO = 1e-13
"""A zero of at most this size counts as 0, up to rounding."""
AT_MINUS_ONE = 1e-4
"""Zeros within this distance from z = -1 count as zeros at infinity; rounding moves repeated zeros
far.
"""
REAL_ANGLE = 1e-6
"""A pair of poles within this angle [rad] from the negative axis counts as a repeated real pole."""
AWAY = 1.7 + 0.9j
"""Point of the plane, in units of the size of poles and zeros, at which a leading coefficient is
computed.
"""


def continuous_controller(controller: Any, *, method: ContinuationMethod = "zoh") -> StateSpace:
    """The continuous system from which a method of `discretise` makes the given sampled system.

    Parameters
    ----------
    controller
        Sampled StateSpace or TransferFunction with known dt; it may also be a plant.
    method
        ``"zoh"``: with held inputs, the continuous system has the given response at the samples.
        ``"tustin"``: inverse of the bilinear transform. ``"matched"``: poles and zeros become their
        logarithms, zeros at z = -1 go to infinity, and the gain at zero frequency stays the same.

    Raises
    ------
    InputError
        The system is continuous, or its sampling time is unknown. For "zoh" and "matched": it has a
        pole on the real axis at or left of z = 0, which no real continuous system gives. For
        "tustin": it has a pole at z = -1. For "matched": it has such a zero other than -1, or
        several inputs or outputs.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import continuous_controller, discretise
    >>> G = control.tf([3.0], [1.0, 2.0, 0.0])
    >>> sampled = discretise(G, dt=0.1, method="zoh")
    >>> sorted(continuous_controller(sampled).poles().real.round(9).tolist())
    [-2.0, 0.0]

    References
    ----------
    G. F. Franklin, J. D. Powell, M. L. Workman, Digital Control of Dynamic Systems, 3rd ed., 1997,
    sections 4.3.1 and 6.2.
    """
    K = as_system(controller, "K")
    need_choice(method, ContinuationMethod, "method")
    if not K.dt:
        raise InputError("K is continuous already (dt = 0); give the sampled system")
    need_sampling_time(K.dt, "K")
    if method == "tustin":
        found = bilinear_continuous(K)
        parts: Matrices = found.A, found.B, found.C, found.D
    else:
        _need_logarithms(K)
        parts = _without_hold(K) if method == "zoh" else _inverse_matched(K)
    labels = {"inputs": K.input_labels, "outputs": K.output_labels}
    return realisation(parts, 0.0, **labels)


def _need_logarithms(K: StateSpace) -> None:
    """Raise InputError for a pole at or left of z = 0 on the real axis."""
    A = np.asarray(K.A, dtype=float)
    if len(A) and pole_may_be_at(0.0, A):
        raise InputError(
            "K has a pole at z = 0, as a delay has; no continuous system has one at any sampling "
            'time: take the delay out, or ask "tustin"'
        )
    for pole in np.linalg.eigvals(A).astype(complex):
        if abs(np.angle(pole)) > math.pi - REAL_ANGLE:
            raise InputError(
                f"K has the pole z = {pole.real:.6g}, left of 0 on the real axis; no real "
                'continuous system has one at any sampling time: ask "tustin"'
            )


def _without_hold(K: StateSpace) -> Matrices:
    """The system whose exact discretisation with a hold is K."""
    n, m = K.B.shape
    if not n:
        return K.A, K.B, K.C, K.D
    units = state_units(K.A - np.eye(n), K.B, K.C)
    block = np.eye(n + m)
    block[:n, :n], block[:n, n:] = K.A * units[:, None] / units, K.B * units[:, None]
    found = np.real(logm(block)) / float(K.dt)
    return found[:n, :n] / units[:, None] * units, found[:n, n:] / units[:, None], K.C, K.D


def matched(K: StateSpace, sample_time: float) -> Matrices:
    """Sampled K with poles and zeros exp(s T), and the same gain at zero frequency.

    All zeros at infinity but one go to z = -1. If K has poles or zeros at 0, s becomes (z - 1) / T
    there, and the factor of this power stays the same.
    """
    poles, zeros = _poles_and_zeros(K)
    at_minus_one = max(len(poles) - len(zeros) - 1, 0)
    gain = _leading_ratio(K, poles, zeros) * np.prod(_difference_ratio(poles, sample_time))
    gain = gain / np.prod(_difference_ratio(zeros, sample_time)) / 2.0**at_minus_one
    ends = np.append(np.exp(zeros * sample_time), -np.ones(at_minus_one))
    return _cascade(np.exp(poles * sample_time), ends, float(gain.real))


def _inverse_matched(K: StateSpace) -> Matrices:
    """The continuous system with the logarithms of the poles and zeros of K."""
    T = float(K.dt)
    poles, every = _poles_and_zeros(K)
    infinite = np.abs(every + 1.0) <= AT_MINUS_ONE
    zeros = every[~infinite]
    zeros = np.where(np.abs(zeros) <= AT_ZERO, 0.0, zeros)
    for zero in zeros:
        if not zero or abs(np.angle(zero)) > math.pi - REAL_ANGLE:
            raise InputError(
                f"K has the zero z = {zero.real:.6g}, at or left of 0 on the real axis; no real "
                'continuous system gives it by matching: ask "zoh" or "tustin"'
            )
    gain = _leading_ratio(K, poles, every) * np.prod(1.0 - every[infinite])
    starts: ComplexArray = np.asarray(np.log(poles) / T, dtype=complex)
    ends: ComplexArray = np.asarray(np.log(zeros) / T, dtype=complex)
    gain = gain * np.prod(_difference_ratio(ends, T)) / np.prod(_difference_ratio(starts, T))
    return _cascade(starts, ends, float(gain.real))


def _difference_ratio(roots: ComplexArray, T: float) -> ComplexArray:
    """The ratio (exp(s T) - 1) / s of z - 1 to s, for roots s."""
    regular = np.where(roots == 0.0, 1.0, roots)
    found: ComplexArray = np.where(roots == 0.0, T, np.expm1(regular * T) / regular)
    return found


def _leading_ratio(K: StateSpace, poles: ComplexArray, zeros: ComplexArray) -> complex:
    """The ratio of the leading coefficients of numerator and denominator."""
    size = float(np.abs(np.concatenate([poles, zeros])).max(initial=0.0)) or 1.0
    point = size * AWAY
    ratio = np.prod(point - poles) / np.prod(point - zeros)
    return complex(K(point)) * complex(ratio)


def _poles_and_zeros(K: StateSpace) -> tuple[ComplexArray, ComplexArray]:
    """Poles and finite zeros of a system with one input and one output."""
    if (K.ninputs, K.noutputs) != (1, 1):
        raise InputError(
            f'K has {K.ninputs} inputs and {K.noutputs} outputs; "matched" belongs to one of each, '
            "whose zeros it takes along"
        )
    return K.poles().astype(complex), K.zeros().astype(complex)


def _cascade(poles: ComplexArray, zeros: ComplexArray, gain: float) -> Matrices:
    """A realisation of gain prod(x - zeros) / prod(x - poles), with a section for each pair of
    poles.
    """
    left = _pairs(zeros)
    if len(zeros) > len(poles):
        raise InputError(f"K has {len(zeros)} zeros and {len(poles)} poles; it is improper")
    found: Matrices = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1) * gain
    for pair in _pairs(poles):
        over = left.pop(0) if left else np.zeros(0, dtype=complex)
        found = in_series(found, _section(pair, over))
    return found


def _pairs(roots: ComplexArray) -> list[ComplexArray]:
    """Groups of roots: complex pairs, then real roots in pairs; the last one may be single."""
    up = roots[roots.imag > 0.0]
    pairs = [np.array([root, root.conjugate()]) for root in up]
    real = np.sort(roots[roots.imag == 0.0].real)[::-1].astype(complex)
    return pairs + [real[k : k + 2] for k in range(0, len(real), 2)]


def _section(poles: ComplexArray, zeros: ComplexArray) -> Matrices:
    """A realisation of one pair of poles or one pole, with at most as many zeros."""
    n = len(poles)
    a, b = (np.real(np.atleast_1d(np.poly(roots))) for roots in (poles, zeros))
    b = np.append(np.zeros(n + 1 - len(b)), b)
    direct = b[0]
    rest = b[1:] - direct * a[1:]
    if n == 1:
        return np.array([[poles[0].real]]), np.eye(1), rest[None], np.array([[direct]])
    p, q = poles
    if p.imag:
        A = np.array([[p.real, p.imag], [-p.imag, p.real]])
    else:
        A = np.array([[p.real, 1.0], [0.0, q.real]])
    # For this A and B = [0, 1]': C (x - A)^-1 B = (c1 A12 + c2 (x - A11)) / det.
    c2 = rest[0]
    c1 = (rest[1] + c2 * A[0, 0]) / A[0, 1]
    return A, np.array([[0.0], [1.0]]), np.array([[c1, c2]]), np.array([[direct]])
