"""The proof of a peak: multipliers that prove one bound on intervals that cover a band.

Scalings that are functions of frequency, if there are any, replace most intervals. A repeated proof
makes no search: the multipliers are stored, and the kernel recomputes everything else from the
system. The theorem for one interval is in `workbench.certify.interval`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from workbench._core.arrays import EPS
from workbench.certify.band_cover import CertifiedInterval
from workbench.certify.interval import (
    Multipliers,
    certified_interval,
    proven_in_balls,
    proven_in_doubles,
)
from workbench.certify.mu_bound import structured
from workbench.certify.proofs.scaled_system import ScalingFunctions, scaled_interval
from workbench.certify.stable_system import StableSystem, stable_system
from workbench.structure import Structure

PIECES = 40
"""Largest number of pieces into which a gap is divided if rounding differs from that of the run.
With equal rounding none is needed. With half of them a proof on another processor may be refused;
double takes longer to refuse a wrong proof.
"""
WIDENED_REACH = 1.1
"""Factor on the half-width of linear multipliers, since they prove more than was needed. It leaves
room for rounding that differs between processors. With half of the distance from 1 gaps are proven
in pieces more often; with double of it D is more often not definite, and the second try is used.
"""


@dataclass(frozen=True, eq=False)
class PeakProof:
    """Intervals with multipliers that prove the bound ``beta`` of mu on a band [rad/s].

    If there are ``scalings``, intervals need to cover only the frequencies that these leave open.
    """

    beta: float
    intervals: tuple[CertifiedInterval, ...]
    band: tuple[float, float] = (0.0, math.inf)
    scalings: ScalingFunctions | None = None


def proves(system: Any, structure: Structure, proof: PeakProof, bound: float) -> str:
    """Prove again that mu is at most `bound` on the proof's band; returns an empty text, or what
    fails.

    Parameters
    ----------
    system
        Stable system with c outputs and r inputs.
    structure
        Blocks of Delta; only the part of the multipliers that they allow is used.
    bound
        The bound; it must not be below the proof's beta.

    Raises
    ------
    InputError
        As `stable_system`; the system does not fit the structure.
    """
    stable = stable_system(system, sampled=True)
    structure.check(stable.D)
    if not proof.beta <= bound:
        return f"the proof is one of {proof.beta:.9g}, which is above {bound:.9g}"
    if not proof.intervals and proof.scalings is None and stable.vanishes():
        return ""
    intervals = sorted(proof.intervals, key=lambda interval: interval.low)
    found = [_ends(stable, structure, one, proof.beta) for one in intervals]
    if proof.scalings is not None:
        fault = proof.scalings.fault(len(structure))
        if fault:
            return fault
        found.append(scaled_interval(stable, structure, proof.scalings, proof.beta))
    for low, high in gaps([ends for ends in found if ends is not None], proof.band):
        about = [one for one in intervals if one.low <= high and low <= one.high]
        if not _gap_is_proven(stable, structure, about, (low, high), proof.beta):
            nearest = _nearest(about, _middle_frequency(low, high))
            if not nearest or (high == proof.band[1] and nearest[0].high < high):
                return f"no interval covers the frequencies above {low:.6g} rad/s"
            return (
                f"the multipliers at {nearest[0].omega:.6g} rad/s do not prove {proof.beta:.9g} "
                f"from {low:.6g} to {high:.6g} rad/s"
            )
    return ""


def _ends(
    system: StableSystem, structure: Structure, interval: CertifiedInterval, beta: float
) -> tuple[float, float] | None:
    """Ends of the interval on which multipliers hold in doubles; it may be wider than the stored
    one.
    """
    multipliers, slopes = _multipliers(structure, interval, interval.omega)
    if slopes is None:
        return proven_in_doubles(system, multipliers, beta, interval.omega, end_margin=0.0)[0]
    reach = max(interval.omega - interval.low, interval.high - interval.omega)
    for factor in (
        WIDENED_REACH,
        1.0,
    ):  # D may be positive definite up to the stored ends and not beyond
        half = min(factor * reach, interval.omega)
        ends = proven_in_doubles(system, multipliers, beta, interval.omega, slopes, half, 0.0)[0]
        if ends is not None:
            return ends
    return None


def _multipliers(
    structure: Structure, interval: CertifiedInterval, omega: float
) -> tuple[Multipliers, Multipliers | None]:
    """An interval's multipliers at a frequency, limited to the structure, and their slopes."""
    slopes = None if interval.slopes is None else structured(structure, *interval.slopes)
    return structured(structure, *interval.multipliers(omega)), slopes


def gaps(
    intervals: list[tuple[float, float]], band: tuple[float, float]
) -> list[tuple[float, float]]:
    """Parts of the band that no interval covers."""
    (reached, top), found = band, []
    for low, high in sorted(intervals):
        if low > top or high < reached:
            continue
        if low > reached:
            found.append((reached, low))
        reached = max(reached, high)
    if reached < top or not any(low <= top and band[0] <= high for low, high in intervals):
        found.append((reached, top))
    return found


def _nearest(intervals: list[CertifiedInterval], omega: float) -> list[CertifiedInterval]:
    """The intervals, ordered by the distance of their multipliers from a frequency."""
    if math.isinf(omega):
        return sorted(intervals, key=lambda one: -one.omega)
    return sorted(intervals, key=lambda one: abs(one.omega - omega))


def _gap_is_proven(
    system: StableSystem,
    structure: Structure,
    about: list[CertifiedInterval],
    gap: tuple[float, float],
    beta: float,
) -> bool:
    """Whether multipliers of the intervals `about` a gap prove beta on all of it; balls are used
    too.
    """
    pieces = [gap]
    for one in _nearest(about, _middle_frequency(*gap)):
        if one.slopes is None and pieces:
            (D_left, D_right, G), _ = _multipliers(structure, one, one.omega)
            ends = proven_in_balls(system, (D_left, D_right, G), beta, one.omega)
            pieces = [rest for piece in pieces for rest in gaps([ends] if ends else [], piece)]
    for _ in range(PIECES):
        if not pieces:
            return True
        low, high = pieces.pop()
        omega = _middle_frequency(low, high)
        for one in _nearest(about, omega):
            (D_left, D_right, G), slopes = _multipliers(structure, one, omega)
            ends = None
            if slopes is not None:
                half = (1 + 8 * EPS) * max(omega - low, high - omega) + 4 * EPS * omega
                ends = certified_interval(
                    system, D_left, D_right, G, beta, omega, slopes, half, 0.0
                )
            if ends is None and (slopes is None or math.isfinite(omega)):
                # Fixed at their values here, they prove less, and rounding hides less of it.
                ends = certified_interval(system, D_left, D_right, G, beta, omega, end_margin=0.0)
            if ends is not None:
                break
        else:
            if all(one.slopes is None for one in about):
                return False
            ends = omega, omega
        if low < ends[0]:
            pieces.append((low, ends[0]))
        if ends[1] < high:
            pieces.append((ends[1], high))
    return not pieces


def _middle_frequency(low: float, high: float) -> float:
    """A frequency in the middle of a piece."""
    return math.inf if math.isinf(high) else (low + high) / 2
