"""The supremum of mu over frequency, proven by scalings that are functions of frequency."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from workbench.certify.agreement import need_agreement
from workbench.certify.band_cover import BandCover, refined_bounds
from workbench.certify.proofs.peak_proof import gaps
from workbench.certify.proofs.scaled_system import ScalingFunctions, scaled_interval
from workbench.mu.frequency.attained import LOWER_BOUND_SHARE, attained_peak
from workbench.mu.frequency.peak_bounds import Peak, PeakChecker
from workbench.mu.frequency.peak_sweep import PeakSweep, with_least_near_top
from workbench.mu.frequency.sweep import bounds_at, fitting
from workbench.structure import Structure

SCALINGS_PROVE = "scalings that are functions of frequency prove it"
"""What the upper bound of such a peak rests on."""
WHOLE_AXIS = (0.0, math.inf)
"""The band [rad/s] of such a peak."""
REST_TOLERANCE, REST_STEPS = 1e-4, 20
"""Tolerance, and largest number of steps, for covering by intervals the part of the axis that
scalings leave open. It is that of a norm, `NORM_TOLERANCE`. Half or double changes the time, and
where the proof is given up.
"""


def scaled_peak(
    system: Any, structure: Structure, scalings: ScalingFunctions, upper: float
) -> Peak | None:
    """The peak whose upper bound `upper` the scalings prove; None where they do not.

    Parameters
    ----------
    system
        The stable system that Delta closes, in continuous time.
    structure
        Blocks of Delta. Real scalars count as complex ones in the upper bound.
    scalings
        Scalings of the first blocks.
    upper
        The bound to prove.

    Raises
    ------
    InputError
        The system does not fit the structure, or is unstable or improper.
    ContradictionError
        The lower bound is above the upper one.
    """
    stable = fitting(system, structure)
    ends = scaled_interval(stable, structure, scalings, upper)
    if ends is None:
        return None
    sweep = PeakSweep(stable, structure)
    # Only maxima are refined, for the lower bound; nothing has to be proven between frequencies.
    found = refined_bounds(sweep, stable.poles, lambda some: np.ones(some.omega.size - 1, bool))
    at = partial(bounds_at, stable, structure)
    cover = BandCover(stable, at, REST_TOLERANCE, found, holds=sweep.holds)
    cover.beta, cover.open = upper, gaps([ends], WHOLE_AXIS)
    cover.complete(REST_STEPS, upper)
    if cover.proven > upper:
        return None
    found = with_least_near_top(cover.found, structure, LOWER_BOUND_SHARE)
    below = attained_peak(stable, structure, found, whole_axis=True)
    need_agreement(below.value, upper, "the peak of mu", upper_claim=SCALINGS_PROVE)
    message = f"scalings from {ends[0]:.3g} to {ends[1]:.3g} rad/s"
    intervals = tuple(cover.intervals)
    parts = below.value, upper, below.omega, below.Delta, intervals, message
    return Peak(*parts, scalings=scalings).with_checker(PeakChecker(system, structure))
