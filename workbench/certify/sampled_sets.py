"""Robust stability of a sampled loop for a set of sampled plants, proven between frequencies.

The plants are G(z) (1 + W_c(jw) delta_c + W_r(jw) delta_r) at z = exp(jwT), |delta_c| <= 1 complex,
-1 <= delta_r <= 1 real, G the sampled nominal and w up to half the sampling rate. With the
complementary sensitivity T of the nominal loop, all loops are stable if the nominal one is and

    1 + T(z) (W_c(jw) delta_c + W_r(jw) delta_r) != 0   at every w and every delta.

Mu is the reciprocal of the least size of a delta that makes the left side 0. On an interval of
frequencies T W_r is enclosed in a disc and |T W_c| is bounded: T by the Neumann series of its
resolvent, the weights by the distances of jw from their roots.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import SolverError
from workbench.systems.balancing import balancing

RESPONSE_ROUNDING = 1e-10
"""Relative error of the responses, by which bounds are raised. It allows for some hundred
roundings, a thousand times enlarged by the resolvent, and is not derived from the realisation. None
of the nearest tests feels half or double.
"""
BISECTIONS = 60
"""Number of bisections of the bracket of mu. 60 leave less than the last bit of a double. With half
of them bounds have nine digits; more change nothing.
"""
MOST_INTERVALS = 400_000
"""The search gives up after this many intervals, a thousand times those at the start. A loop that
needs more is almost unstable, and the error says so. Half or double changes how near to instability
a loop may be.
"""
STARTING_INTERVALS = 400
"""Number of intervals at the start, in equal steps of log frequency except for the first one. They
are 80 a decade. Half or double changes the number of cuts, and no bound.
"""
FIRST_SHARE = 1e-5
"""End of the first interval, relative to half the sampling rate. The first interval reaches from 0
to there and is cut like all others. Half or double changes where cuts start, and no bound.
"""
LARGEST_CONDITION, LARGEST_ERROR, DISTANCE_FACTOR = 1e12, 1e-7, 10.0
"""Limits for modal coordinates: their condition number, the relative distance of their response
from that of T, and the factor by which the true distance may exceed the one seen. Four digits of a
response remain at such a condition, and points that are tried show more. Half or double: the given
realisation is used a little more or less often.
"""
BATCH = 20_000
"""Number of intervals treated together. Their arrays take a few MB. Half or double changes memory
and time only.
"""


class Roots(Protocol):
    """A weight, gain prod(s - zeros) / prod(s - poles); its poles are stable."""

    @property
    def zeros(self) -> ComplexArray: ...

    @property
    def poles(self) -> ComplexArray: ...

    @property
    def gain(self) -> float: ...


@dataclass(frozen=True, eq=False)
class SetPeak:
    """Bounds of the supremum of mu, and the frequency [rad/s] of the lower bound.

    Unlike a `Peak`, it is of a sampled loop whose weights are in continuous time.
    """

    lower: float
    upper: float
    omega: float


def sampled_set_peak(
    T: StateSpace, W_c: Roots, W_r: Roots | None, tolerance: float = 1e-3
) -> SetPeak:
    """Bounds of the largest mu of 1 + T (W_c delta_c + W_r delta_r) up to half the sampling rate.

    Parameters
    ----------
    T
        Complementary sensitivity of the nominal loop, stable, sampled, with one input and output.
    tolerance
        Largest relative distance of the bounds.

    Raises
    ------
    SolverError
        The bounds are still farther apart after `MOST_INTERVALS` intervals.
    """
    nyquist = np.pi / float(T.dt)
    edges = np.concatenate(
        [[0.0], np.geomspace(FIRST_SHARE * nyquist, nyquist, STARTING_INTERVALS)]
    )
    low, high = edges[:-1], edges[1:]
    lower, omega, upper, seen = 0.0, 0.0, 0.0, 0
    form = _well_conditioned(T)
    while low.size:
        seen += low.size
        if seen > MOST_INTERVALS:
            raise SolverError(
                f"mu of the sampled loop lies above {lower:.6g}, but its upper bound is not within "
                f"{tolerance:.3g} of it after {seen} intervals: the loop is almost unstable"
            )
        batch = slice(0, BATCH)
        own_low, own_high = low[batch], high[batch]
        middle, half = (own_low + own_high) / 2, (own_high - own_low) / 2
        at, bound = _bounds(form, W_c, W_r, float(T.dt), middle, half)
        best = int(at.argmax())
        if at[best] > lower:
            lower, omega = float(at[best]), float(middle[best])
        done = bound <= max(lower * (1 + tolerance), np.finfo(float).tiny)
        upper = max(upper, float(bound[done].max(initial=0.0)))
        left = ~done
        low = np.concatenate([own_low[left], middle[left], low[BATCH:]])
        high = np.concatenate([middle[left], own_high[left], high[BATCH:]])
    return SetPeak(lower, upper, omega)


def mu_at(T: StateSpace, W_c: Roots, W_r: Roots | None, omega: RealArray) -> RealArray:
    """Mu (F,) of 1 + T (W_c delta_c + W_r delta_r) at frequencies [rad/s] (F,)."""
    return _bounds(_well_conditioned(T), W_c, W_r, float(T.dt), omega, np.zeros(len(omega)))[0]


class Form(NamedTuple):
    """A realisation of T in coordinates in which its resolvent is small.

    Unlike a `StateSpace`, it may be complex, in modal coordinates, and has a bound of its error.

    ``error`` bounds the distance of its response from that of T.
    """

    A: Array
    B: Array
    C: Array
    D: float
    error: float


def _well_conditioned(T: StateSpace) -> Form:
    """T with scaled states, or in modal coordinates if these give the same response."""
    M, n = np.block([[T.A, T.B], [T.C, T.D]]), T.nstates
    scale = balancing(M, n)[0][:n]
    A = np.asarray(T.A) * scale[:, None] / scale
    B, C = np.asarray(T.B) * scale[:, None], np.asarray(T.C) / scale
    plain = Form(A, B, C, float(T.D[0, 0]), 0.0)
    if n == 0:
        return plain
    _, V = np.linalg.eig(A)
    if not np.linalg.cond(V) < LARGEST_CONDITION:
        return plain
    inverse = np.linalg.inv(V)
    B, C = inverse @ B, C @ V
    size = np.sqrt(np.abs(C[0]) / np.maximum(np.abs(B[:, 0]), np.finfo(float).tiny))
    size = np.where((size > 0) & np.isfinite(size), size, 1.0)
    modal = Form(inverse @ A @ V * size[:, None] / size, B * size[:, None], C / size, plain.D, 0.0)
    omega = np.geomspace(FIRST_SHARE, 1.0, STARTING_INTERVALS) * np.pi / float(T.dt)
    still = np.zeros(len(omega))
    one, other = (_sensitivity(form, float(T.dt), omega, still)[0] for form in (plain, modal))
    apart = float(np.abs(one - other).max())
    if not apart <= LARGEST_ERROR * float(np.abs(one).max()):
        return plain
    return modal._replace(error=DISTANCE_FACTOR * apart)


def _bounds(
    form: Form,
    W_c: Roots,
    W_r: Roots | None,
    period: float,
    middle: RealArray,
    half: RealArray,
) -> tuple[RealArray, RealArray]:
    """Mu (N,) in the middle of intervals, and bounds (N,) of mu on each whole interval."""
    T, T_off = _sensitivity(form, period, middle, half)
    c, c_off = _weight(W_c, middle, half)
    with np.errstate(invalid="ignore"):  # an infinite disc times a weight of zero is no disc
        reach = (np.abs(T) + T_off) * (np.abs(c) + c_off)
    if W_r is None:
        return np.abs(T * c), reach * (1 + RESPONSE_ROUNDING)
    r, r_off = _weight(W_r, middle, half)
    with np.errstate(invalid="ignore"):
        away = (np.abs(T) + T_off) * r_off + T_off * np.abs(r)
    here = _mu(T * r, np.abs(T * c))
    return here * (1 - RESPONSE_ROUNDING), _mu(T * r, reach + away) * (1 + RESPONSE_ROUNDING)


def _sensitivity(
    form: Form,
    period: float,
    middle: RealArray,
    half: RealArray,
) -> tuple[ComplexArray, RealArray]:
    """T (N,) in the middle of intervals, and the radii (N,) of discs that contain it on each
    interval.

    With R = (z I - A)^-1 and |z - z_m| <= d, the Neumann series gives |T(z) - T(z_m)| <=
    d |C R| |R B| / (1 - d |R|) where d |R| < 1; elsewhere the radius is infinite.
    """
    A, B, C, D, error = form
    z = np.exp(1j * period * middle)
    R: ComplexArray = np.linalg.inv(z[:, None, None] * np.eye(len(A)) - A)
    left, right = C @ R, R @ B
    value: ComplexArray = (C @ right)[:, 0, 0] + D
    moved = period * half
    share = moved * np.linalg.norm(R, axis=(1, 2))
    size = np.linalg.norm(left, axis=(1, 2)) * np.linalg.norm(right, axis=(1, 2))
    with np.errstate(divide="ignore", invalid="ignore"):
        off: RealArray = np.where(share < 1.0, moved * size / (1.0 - share), np.inf)
    return value, off + error


def _weight(W: Roots, middle: RealArray, half: RealArray) -> tuple[ComplexArray, RealArray]:
    """A weight (N,) in the middle of intervals, and radii (N,) of discs that contain it on each
    interval.
    """
    s = 1j * middle[:, None]
    above, below = s - W.zeros, s - W.poles
    zero = (above == 0).any(axis=1)
    logs = np.log(np.where(above == 0, 1.0, above)).sum(axis=1) - np.log(below).sum(axis=1)
    value = np.where(zero, 0.0, W.gain * np.exp(logs))
    room = np.abs(below) - half[:, None]
    # On the interval every factor moves by `half` at most, so |W| is at most `largest`. W moves by
    # no more than |W| would if every factor moved in its own direction.
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(np.abs(above) + half[:, None]).sum(axis=1) - np.log(room).sum(axis=1)
        largest = np.where((room > 0).all(axis=1), abs(W.gain) * np.exp(logs), np.inf)
    return value, np.maximum(largest - np.abs(value), 0.0)


def _mu(n: ComplexArray, radius: RealArray) -> RealArray:
    """The least m (N,) at which -m has a distance of at least `radius` from the segment from -n to
    n.
    """
    finite = np.isfinite(radius)
    radius = np.where(finite, radius, 0.0)
    low, high = np.zeros(len(n)), np.abs(n) + radius
    size = np.maximum(np.abs(n), np.finfo(float).tiny)
    turned = n / size
    for _ in range(BISECTIONS):
        m = (low + high) / 2
        along = np.clip(m * np.abs(turned.real), 0.0, size)
        apart = np.hypot(m * turned.real - np.copysign(along, turned.real), m * turned.imag)
        inside = apart < radius
        low, high = np.where(inside, m, low), np.where(inside, high, m)
    return np.where(finite, high, np.inf)
