"""The proof of a peak: multipliers that prove one bound on intervals which cover a band.

Nothing is searched when it is proven again: the multipliers are those stored, and what the kernel
needs besides them is recomputed from the system.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from workbench.arrays import EPS
from workbench.certify.cover import CertifiedInterval
from workbench.certify.interval import certified_interval
from workbench.certify.mu_bound import structured
from workbench.certify.stable_system import StableSystem, stable_system
from workbench.structure import Structure

PIECES = 40
"""Most pieces into which one interval is divided where rounding differs from that of the run."""


@dataclass(frozen=True, eq=False)
class PeakProof:
    """Intervals with multipliers that prove the bound ``beta`` of mu on a band [rad/s]."""

    beta: float
    intervals: tuple[CertifiedInterval, ...]
    band: tuple[float, float] = (0.0, math.inf)


def proves(system: Any, structure: Structure, proof: PeakProof, bound: float) -> str:
    """Prove again that mu is at most `bound` on the proof's band; the empty text, or what fails.

    Parameters
    ----------
    system
        Stable continuous-time system with c outputs and r inputs.
    structure
        Blocks of Delta; of the multipliers only the part that they allow is used.
    bound
        May not be below the proof's beta.

    Raises
    ------
    InputError
        As `stable_system`; the system does not fit the structure.
    """
    stable = stable_system(system)
    structure.check(stable.D)
    if not proof.beta <= bound:
        return f"the proof is one of {proof.beta:.9g}, which is above {bound:.9g}"
    reached, top = proof.band
    closed = False
    for one in sorted(proof.intervals, key=lambda interval: interval.low):
        if one.low > reached:
            break
        if one.high > reached or not closed:
            if not _holds(stable, structure, one, proof.beta):
                return (
                    f"the multipliers at {one.omega:.6g} rad/s do not prove {proof.beta:.9g} from "
                    f"{one.low:.6g} to {one.high:.6g} rad/s"
                )
            reached, closed = max(reached, one.high), True
    if (closed and reached >= top) or _is_zero(stable):
        return ""
    return f"no interval covers the frequencies above {reached:.6g} rad/s"


def _is_zero(system: StableSystem) -> bool:
    """Whether the response is zero because no input or no output touches the states."""
    return not system.D.any() and not (system.B.any() and system.C.any())


def _holds(
    system: StableSystem, structure: Structure, interval: CertifiedInterval, beta: float
) -> bool:
    """Whether the multipliers of an interval prove beta on all of it.

    Where another machine's rounding leaves a part of it open, the multipliers at the middle of that
    part are tried there.
    """
    slopes = None
    if interval.slopes is not None:
        slopes = structured(structure, *interval.slopes)
    pieces = [(interval.low, interval.high, interval.omega)]
    for _ in range(PIECES):
        low, high, omega = pieces.pop()
        D_left, D_right, G = structured(structure, *interval.multipliers(omega))
        half = math.inf
        if slopes is not None:
            half = (1 + 8 * EPS) * max(omega - low, high - omega) + 4 * EPS * omega
        ends = certified_interval(
            system, D_left, D_right, G, beta, omega, slopes, half, end_margin=0.0
        )
        if ends is None and slopes is None:
            return False
        proven = ends or (omega, omega)
        if low < proven[0]:
            pieces.append((low, proven[0], _between(low, proven[0])))
        if proven[1] < high:
            pieces.append((proven[1], high, _between(proven[1], high)))
        if not pieces:
            return True
    return False


def _between(low: float, high: float) -> float:
    """A frequency in the middle of a piece."""
    if math.isinf(high):
        return math.inf
    return (low + high) / 2
