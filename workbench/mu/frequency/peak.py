"""The supremum of mu over frequency, certified between grid points by `certify.band_cover`."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from workbench.certify.agreement import need_agreement
from workbench.certify.band_cover import BandCover, refined_bounds
from workbench.certify.stable_system import StableSystem
from workbench.errors import InputError
from workbench.input_checks import as_list, is_real, need_count, need_numbers, need_tolerance
from workbench.mu.frequency.attained import LOWER_BOUND_SHARE, attained_peak
from workbench.mu.frequency.complex_part import complex_part_added, summed
from workbench.mu.frequency.peak_bounds import Peak, PeakChecker
from workbench.mu.frequency.peak_sweep import PeakSweep, with_least_near_top
from workbench.mu.frequency.sweep import bounds_at, fitting
from workbench.structure import Real, Structure
from workbench.systems.range_hints import warn_far_frequencies

INTERVALS_COVER = "intervals on which multipliers prove it cover the band"
"""What the upper bound of a peak rests on."""


def peak(
    system: Any,
    structure: Structure,
    *,
    tolerance: float = 1e-3,
    complex_part: float = 0.0,
    band: tuple[float, float] = (0.0, math.inf),
    steps: int = 500,
) -> Peak:
    """Certified bounds of the supremum of mu over a band of frequencies, its ends included.

    Parameters
    ----------
    system
        The stable system that Delta closes: a StateSpace or TransferFunction with c outputs and r
        inputs, in continuous or sampled time.
    structure
        Blocks of Delta.
    tolerance
        Relative distance by which the bound may lie above the largest upper bound at any one
        frequency.
    complex_part
        Complex uncertainty added to every real scalar, as a share of it; see `complex_part_added`.
    band
        Lowest and highest frequency [rad/s]; by default all frequencies with 0 and infinity.
    steps
        The tolerance becomes ten times as large each time this number of intervals is used up.

    Returns
    -------
    Peak
        Its message says where the tolerance was missed.

    Raises
    ------
    InputError
        The system does not fit the structure, or is unstable or improper; all blocks are
        real scalars and there is no complex part; or an argument is out of its range.
    ContradictionError
        The lower bound is above the upper one.

    Warns
    -----
    RangeWarning
        The band lies above 100 times the fastest pole, or below 1/100 of the slowest.
    """
    need_tolerance(tolerance)
    need_count("steps", steps)
    asked = low, high = _ends(band)
    original = fitting(system, structure, sampled=True)
    if not isinstance(system, StableSystem):
        warn_far_frequencies(band, system)
    low, high = original.plane(low), original.plane(high)
    if not low < high:
        raise InputError(f"band is {band}; it lies beyond half the sampling rate")
    need_numbers(complex_part=complex_part)
    if complex_part:
        stable, larger = complex_part_added(original, structure, complex_part)
    elif all(isinstance(block, Real) for block in structure):
        raise InputError(
            "the structure has real scalars only: mu is then not continuous in frequency, a peak "
            "may stand at a single frequency that no bound shows; give complex_part, for instance "
            "0.01, or add the complex block of a performance channel"
        )
    else:
        stable, larger = original, structure
    cover, message = covered(stable, larger, tolerance, (low, high), steps)
    found = with_least_near_top(cover.found, larger, LOWER_BOUND_SHARE)
    below = attained_peak(stable, larger, found, whole_axis=(low, high) == (0.0, math.inf))
    lower, omega, Delta = below.value, below.omega, below.Delta
    need_agreement(lower, cover.proven, "the peak of mu", upper_claim=INTERVALS_COVER)
    intervals = tuple(sorted(cover.intervals, key=lambda interval: interval.low))
    if complex_part:
        Delta = summed(Delta, structure, complex_part)
    ends = float(original.angular(low)), float(original.angular(high))
    band = ends if original.period else band
    omega, period = float(original.angular(omega)), original.period
    parts = lower, cover.proven, omega, Delta, intervals, message
    peak = Peak(*parts, complex_part=complex_part, band=band, dt=period)
    return peak.with_checker(PeakChecker(system, structure, band=asked))


def covered(
    stable: StableSystem,
    structure: Structure,
    tolerance: float,
    band: tuple[float, float],
    steps: int,
    most: float = math.inf,
) -> tuple[BandCover, str]:
    """The band covered by intervals with multipliers, and how that ended; see `BandCover`."""
    at = partial(bounds_at, stable, structure)
    sweep = PeakSweep(stable, structure, band)
    found = refined_bounds(sweep, stable.poles, sweep.settled)
    # G is left out: without it, these multipliers of real scalars change less over frequency.
    real = any(isinstance(block, Real) for block in structure)
    plain = partial(bounds_at, stable, structure.complexified()) if real else None
    cover = BandCover(stable, at, tolerance, found, plain, sweep.holds)
    return cover, cover.complete(steps, most)


def _ends(band: Any) -> tuple[float, float]:
    """The lower and the upper end of a band; raises InputError if it is no band."""
    ends = as_list(band, "band")
    if not (len(ends) == 2 and all(map(is_real, ends)) and 0.0 <= ends[0] < ends[1]):
        raise InputError(
            f"band is {band!r}; it must be two frequencies [rad/s], the lower one first"
        )
    return ends[0], ends[1]
