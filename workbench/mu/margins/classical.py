"""Gain, phase, delay and modulus margins of a loop, with every crossing.

Where the response of L crosses the real axis, L(s) - L(-s) is zero; where it crosses the unit
circle, 1 - L(s) L(-s) is. Zeros of these systems on the imaginary axis are the crossings, so none
is missed between points of a grid. Each is refined on the response itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import eigvals
from scipy.optimize import brentq

from workbench.answer import Answer
from workbench.arrays import RealArray
from workbench.certify.norms import certified_norm
from workbench.certify.stability import stability_of
from workbench.certify.stable_system import angular_frequency
from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.mu.margins.classical_checks import ClassicalChecker, closed
from workbench.systems.balancing import balanced, speed
from workbench.systems.bilinear import bilinear_continuous
from workbench.systems.conversion import as_system
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import realisation

NEAR_AXIS = 1e-3
"""Zeros whose real part is a smaller share of their size are tried as crossings."""
BRACKETS = (1e-9, 1e-7, 1e-5, 1e-3, 1e-2)
"""Relative half-widths of the intervals about a zero in which a change of sign is looked for."""
TOUCHING = 1e-9
"""Size of a curve at its zero, over its size nearby, up to which it touches the axis there."""
LARGEST_CONDITION = 1e12
"""Condition number of A from which L counts as having a pole at 0."""
SAME = 1e-7
"""Relative distance of crossings that are one."""


@dataclass(frozen=True, eq=False, repr=False)
class ClassicalMargins(Answer):
    """Every crossing of a loop that is closed with negative feedback, and the least margins.

    ``gains`` (K, 2): factors on the loop's gain with which the closed loop has a pole at a
    frequency [rad/s]. ``phases`` (K, 2): phase margin [deg] at each frequency with |L| = 1;
    negative ones are margins against lead. ``delays`` (K, 2): the least delay [s] with which the
    closed loop has a pole at each of these. ``modulus`` is the distance of L from -1, a proven
    lower bound; 0 where the loop is not ``stable``.
    """

    gains: RealArray
    phases: RealArray
    delays: RealArray
    modulus: float
    stable: bool

    @property
    def gain(self) -> tuple[float, float]:
        """The nearest factors below and above 1; 0 and infinity where there is none."""
        factors = self.gains[:, 0]
        low = factors[factors < 1].max(initial=0.0)
        return float(low), float(factors[factors > 1].min(initial=math.inf))

    @property
    def gain_db(self) -> float:
        """The least change of the gain, up or down [dB]."""
        low, high = self.gain
        with np.errstate(divide="ignore"):
            return float(20 * min(np.log10(high), -np.log10(low)))

    @property
    def phase(self) -> float:
        """The least phase margin, of lag or lead [deg]; infinite without a crossing."""
        return float(np.abs(self.phases[:, 0]).min(initial=math.inf))

    @property
    def delay(self) -> float:
        """The least delay margin [s]; infinite without a crossing."""
        return float(self.delays[:, 0].min(initial=math.inf))

    def said(self) -> str:
        low, high = self.gain
        state = "" if self.stable else "the closed loop is UNSTABLE; "
        return (
            f"ClassicalMargins: {state}gain from {low:.4g} to {high:.4g}, phase {self.phase:.4g} "
            f"degrees, delay {self.delay:.4g} s, modulus {self.modulus:.4g}"
        )


def classical_margins(loop: Any) -> ClassicalMargins:
    """Margins of a loop of one input and one output, closed with negative feedback.

    Parameters
    ----------
    loop
        L: StateSpace or TransferFunction, in continuous or sampled time; or what holds one.

    Raises
    ------
    InputError
        L has several inputs or outputs, or is sampled with a sampling time that is not given.
    """
    L = as_system(loop, "loop")
    if not L.issiso():
        raise InputError(
            f"loop has {L.noutputs} outputs and {L.ninputs} inputs; one of each is needed: "
            "`loop_margins` takes plants and controllers of several channels"
        )
    if L.dt is True:
        raise InputError("the loop is sampled, but its sampling time is not given: set its dt [s]")
    period, plane = float(L.dt or 0.0), bilinear_continuous(L) if L.dt else L
    rate = _rate(plane)
    A, B, C = balanced(plane.A / rate, plane.B / rate, plane.C)
    D = float(plane.D[0, 0])
    scaled = realisation((A, B, C, plane.D), 0.0)

    def value(omega: RealArray) -> Any:
        with np.errstate(all="ignore"):
            return response(scaled, omega)[:, 0, 0]

    def angular(omega: RealArray) -> RealArray:
        """Frequencies [rad/s] of the loop itself."""
        found: RealArray = angular_frequency(rate * omega, period)
        return found

    grid = frequencies_of(scaled)
    real = _crossings(lambda w: value(w).imag, _zeros(*_odd_part(A, B, C)), grid)
    # At 0 and at infinity (sampled: half the sampling rate) the response is real in any case.
    with np.errstate(divide="ignore", invalid="ignore"):
        # Where L itself is zero no gain makes it -1.
        seen = np.abs(value(real)) > TOUCHING * np.abs(value(real * (1 + BRACKETS[-1])))
        at = np.concatenate([np.where(seen, value(real).real, 0.0), [_at_zero(scaled), D]])
        factors = -1.0 / at
    real = np.concatenate([angular(real), [0.0, np.pi / period if period else math.inf]])
    known = np.isfinite(at) & (at < 0) & np.isfinite(factors)
    order = np.argsort(real[known])
    gains = np.column_stack([factors, real])[known][order]
    unit = _crossings(lambda w: np.log(np.abs(value(w))), _zeros(*_gain_part(A, B, C, D)), grid)
    phase = np.degrees(np.angle(-value(unit))) if unit.size else np.empty(0)
    omega = angular(unit)
    phases = np.column_stack([phase, omega])
    delays = np.column_stack([np.radians(np.mod(phase, 360.0)) / np.maximum(omega, 1e-300), omega])
    loop = closed(L)
    stable = loop is not None and bool(stability_of(loop).holds)
    modulus = 1.0 / certified_norm(loop) if stable and loop is not None else 0.0
    found = ClassicalMargins(gains, phases, delays, modulus, stable)
    return found.checked_by(ClassicalChecker(L))


def _rate(L: StateSpace) -> float:
    """A frequency [rad/s] to measure others by, a power of two.

    Where all poles are integrators the gain tells it: L is nearly h / s^k at high frequencies.
    """
    if np.linalg.eigvals(L.A).any():
        return speed(L.A)
    row = np.asarray(L.C, dtype=float)
    for k in range(1, L.nstates + 1):
        size = abs(float((row @ L.B).item()))
        if size > 0.0:
            return float(np.exp2(np.round(np.log2(size) / k)))
        row = row @ L.A
    return 1.0


def _at_zero(L: StateSpace) -> float:
    """The response at frequency 0; NaN for a pole there."""
    if L.nstates and np.linalg.cond(L.A) > LARGEST_CONDITION:
        return math.nan
    return float((L.D - L.C @ np.linalg.solve(L.A, L.B)).item()) if L.nstates else L.D.item()


def _odd_part(A: RealArray, B: RealArray, C: RealArray) -> tuple[RealArray, ...]:
    """L(s) - L(-s)."""
    n = len(A)
    both = np.block([[A, np.zeros((n, n))], [np.zeros((n, n)), -A]])
    return both, np.vstack([B, B]), np.hstack([C, C]), np.zeros((1, 1))


def _gain_part(A: RealArray, B: RealArray, C: RealArray, D: float) -> tuple[RealArray, ...]:
    """1 - L(s) L(-s)."""
    n = len(A)
    # L(-s) = D - C (s I + A)^-1 B drives L(s).
    both = np.block([[A, -B @ C], [np.zeros((n, n)), -A]])
    return both, np.vstack([D * B, B]), np.hstack([-C, D * C]), np.array([[1.0 - D * D]])


def _zeros(A: RealArray, B: RealArray, C: RealArray, D: RealArray) -> RealArray:
    """Positive frequencies of zeros on the imaginary axis, or near it."""
    n = len(A)
    if not n:
        return np.empty(0)
    E = np.zeros((n + 1, n + 1))
    E[:n, :n] = np.eye(n)
    with np.errstate(all="ignore"):
        found = np.asarray(eigvals(np.block([[A, B], [C, D]]), E))
    found = found[np.isfinite(found) & (found.imag > 0)]
    return np.sort(found.imag[np.abs(found.real) <= NEAR_AXIS * np.abs(found)])


def _crossings(
    curve: Callable[[RealArray], RealArray], near: RealArray, grid: RealArray
) -> RealArray:
    """Frequencies at which a curve is zero: near some frequencies, or between those of a grid."""

    def at(omega: float) -> float:
        return float(curve(np.array([omega]))[0])

    found: list[float] = []
    values = curve(grid) if grid.size else np.empty(0)
    brackets = [
        (grid[k], grid[k + 1])
        for k in np.flatnonzero(np.diff(np.sign(values)) != 0)
        if np.isfinite(values[k : k + 2]).all()
    ]
    for omega in near:
        for half in BRACKETS:
            low, high = omega * (1 - half), omega * (1 + half)
            if at(low) * at(high) < 0:
                brackets.append((low, high))
                break
        else:
            beside = max(abs(at(omega * (1 - BRACKETS[-1]))), abs(at(omega * (1 + BRACKETS[-1]))))
            if abs(at(omega)) <= TOUCHING * beside:
                found.append(float(omega))
    found += [brentq(at, low, high, xtol=1e-300, rtol=1e-14) for low, high in brackets]
    # A change of sign at a pole is none: the curve is large there.
    found = [w for w in sorted(found) if abs(at(w)) <= 1e-3 * (1 + abs(at(w * (1 + 1e-3))))]
    kept = [w for k, w in enumerate(found) if not k or w - found[k - 1] > SAME * w]
    return np.array(kept)
