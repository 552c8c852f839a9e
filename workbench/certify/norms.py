"""The H-infinity norm of a stable loop, certified at every frequency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.band_cover import BandCover, FrequencyBounds, refined_bounds, with_peak
from workbench.certify.modes.band_peak import largest_singular_value, proven_peak
from workbench.certify.modes.partial_fractions import enclosed_fractions
from workbench.certify.rounding import Enclosure, exact, nearest_power_of_two
from workbench.certify.stable_system import StableSystem, stable_system
from workbench.systems.balancing import with_state_units
from workbench.systems.conversion import as_loop
from workbench.systems.realisation import realisation

NORM_TOLERANCE = 1e-4
"""Relative tolerance of a certified norm: the bound lies at most this far above the norm. Norms are
quoted to three or four digits. Half or double changes the number of intervals by about 1.4.
"""

RESPONSE_ERROR = NORM_TOLERANCE / 100
"""Responses are refined if their error exceeds this share of the largest one. The largest response
only decides where the bound begins; the bound itself is proven on intervals.
"""

FAR = 2.0**200
"""Inputs, outputs and rates beyond this size, or below its reciprocal, are measured in another
unit. Products of four such numbers are doubles. Half or double changes nothing for a system in
usual units.
"""

INTERVALS_BEFORE_COARSENING = 300
"""The tolerance becomes ten times as large after this many intervals. Otherwise a loop whose
response consists of rounding errors would need very many intervals. With half of it loops with many
resonances may be bounded to 1e-3 only; with double of it a loop of rounding errors takes twice as
long. The bound holds always.
"""


def certified_norm(loop: Any) -> float:
    """Upper bound of the H-infinity norm of a stable loop, certified at every frequency.

    Partial fractions prove it if eigenvectors in doubles are good enough. Otherwise the norm is the
    peak of mu for one full block, with the multipliers D = 1: intervals on which these multipliers
    prove the bound cover the band from 0 to infinity, or to half the sampling rate. It lies above
    the norm by no more than a part in 10^4; `workbench.mu.h_infinity_norm` encloses the norm more
    narrowly, from both sides. The loop is any linear system of python-control.

    Examples
    --------
    >>> import control
    >>> from workbench.certify import certified_norm
    >>> bound = certified_norm(control.ss(-1.0, 1.0, 3.0, 0.0))
    >>> 3.0 <= bound <= 3.0003
    True
    """
    loop = as_loop(loop)
    parts = [np.asarray(part, dtype=float) for part in (loop.A, loop.B, loop.C, loop.D)]
    key = (*(part.tobytes() for part in parts), parts[3].shape, loop.dt)
    if key not in _norms:  # checks and second opinions ask for the norm of the same loop
        if len(_norms) >= MOST_KEPT:
            _norms.pop(next(iter(_norms)))
        _norms[key] = _certified_norm(loop)
    return _norms[key]


MOST_KEPT = 16
"""Largest number of norms that are kept. Checks and second opinions of one answer ask for the norms
of a few loops. Half or double changes the time only.
"""
_norms: dict[tuple[object, ...], float] = {}


def _certified_norm(loop: StateSpace) -> float:
    A, B, C, D = (np.asarray(part, dtype=float) for part in (loop.A, loop.B, loop.C, loop.D))
    rate = 1.0 if loop.dt else _unit(A)
    entering = _unit(B / rate)
    leaving = _unit(C, D / entering)
    near = all(1 / FAR < unit < FAR for unit in (rate, entering, leaving))
    if not near:  # squares would overflow or underflow
        inner = A / rate, B / rate / entering, C / leaving, D / entering / leaving
        back = (
            inner[0] * rate,
            inner[1] * entering * rate,
            inner[2] * leaving,
            inner[3] * leaving * entering,
        )
        if all(map(np.array_equal, back, (A, B, C, D))):  # no slow rate and no small entry is lost
            scaled = _certified_norm(realisation(inner, loop.dt or 0.0))
            return float(np.nextafter(scaled * leaving * entering, np.inf))
    parts = [A, B, C, D]
    given = not loop.dt and all(np.isfinite(part).all() for part in parts)
    if given:
        found = _peak_of_fractions([exact(part) for part in with_state_units(*parts)])
        if found is not None:
            return found
    system = stable_system(loop, sampled=True)
    # frequencies other than those tried
    if not given or any(error.any() for error in system.errors):
        found = _peak_of_fractions(system.enclosures)
        if found is not None:
            return found
    return _norm_by_intervals(system)


def _unit(*parts: RealArray) -> float:
    """A power of two near the largest entry of some matrices; 1 if they have none but 0."""
    return float(nearest_power_of_two(max(float(np.abs(part).max(initial=0.0)) for part in parts)))


def _peak_of_fractions(parts: Sequence[Enclosure]) -> float | None:
    """The norm of A, B, C and D, which are proven to be stable too; None if it is not proven."""
    fractions = enclosed_fractions(*parts)
    return None if fractions is None else proven_peak(fractions, NORM_TOLERANCE)


def _norm_by_intervals(system: StableSystem) -> float:
    """The norm by intervals on which the multipliers prove it."""
    c, r = system.D.shape

    def bounds_at(omega: RealArray) -> FrequencyBounds:
        M = system.response(omega, RESPONSE_ERROR)
        F = len(omega)
        D_left, D_right = (np.broadcast_to(np.eye(n, dtype=complex), (F, n, n)) for n in (c, r))
        G = np.zeros((F, r, c), complex)
        # Nothing depends on these numbers: intervals prove the bound, which begins at the largest
        # of them.
        return FrequencyBounds(omega, M, largest_singular_value(M), D_left, D_right, G)

    found = refined_bounds(bounds_at, system.poles).joined(bounds_at(np.array([0.0, np.inf])))
    found = with_peak(found, bounds_at)
    cover = BandCover(system, bounds_at, NORM_TOLERANCE, found)
    cover.complete(INTERVALS_BEFORE_COARSENING)
    return cover.proven
