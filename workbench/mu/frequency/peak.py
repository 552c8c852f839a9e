"""The supremum of mu over frequency, certified between grid points by `certify.cover`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from numbers import Real as Number
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.certify.agreement import need_agreement
from workbench.certify.cover import BandCover, CertifiedInterval, refined_bounds
from workbench.certify.proofs.peak_proof import PeakProof
from workbench.certify.proofs.scaled_system import ScalingFunctions
from workbench.certify.stable_system import StableSystem, bilinear_frequency, stable_system
from workbench.errors import InputError
from workbench.input_checks import need_count, need_tolerance
from workbench.mu.frequency.attained import LOWER_BOUND_SHARE, attained_peak
from workbench.mu.frequency.peak_sweep import PeakSweep, with_least_near_top
from workbench.mu.frequency.sweep import bounds_at, fitting
from workbench.structure import Complex, Real, Structure
from workbench.systems.range_hints import warn_far_frequencies

INTERVALS_COVER = "intervals on which multipliers prove it cover the band"
"""What upper bounds of a peak rest on."""


@dataclass(frozen=True, eq=False)
class Peak:
    """The supremum of mu over a band lies between ``lower`` and ``upper``.

    ``Delta`` (r, c) makes I - M(j omega) Delta singular up to rounding and proves the lower bound;
    it is no larger than 1 / lower, and NaN where lower is 0. ``omega`` [rad/s] is the frequency of
    Delta, or where there is none the frequency of the largest upper bound. ``intervals`` cover the
    band unless upper is infinite.
    ``complex_part`` is the complex uncertainty added to real scalars, as a share of them; the peak
    holds for this larger set of perturbations.
    Of a system with sampling time ``period`` [s] the band ends at half the sampling rate, and
    intervals are over v = 2 / period tan(omega period / 2).
    """

    lower: float
    upper: float
    omega: float
    Delta: Array
    intervals: tuple[CertifiedInterval, ...]
    message: str
    complex_part: float = 0.0
    band: tuple[float, float] = (0.0, math.inf)
    period: float = 0.0
    scalings: ScalingFunctions | None = None

    @property
    def proof(self) -> PeakProof | None:
        """What `proves` of `workbench.certify.proofs` proves again; None for an infinite bound.

        Where there is a complex part, it is a proof for `with_complex_part` of the system.
        """
        if math.isinf(self.upper):
            return None
        return PeakProof(self.upper, self.intervals, self.intervals_band, self.scalings)

    @property
    def intervals_band(self) -> tuple[float, float]:
        """The band in the frequency of the intervals."""
        low, high = (bilinear_frequency(omega, self.period) for omega in self.band)
        return low, high

    def multipliers(self, structure: Structure) -> tuple[Array, Array, Array] | None:
        """D_left (c, c), D_right (r, r) and G (r, c) of the proof at ``omega``; None: none."""
        of = next((one for one in self.intervals if one.low <= self.omega <= one.high), None)
        if of is not None:
            return of.multipliers(self.omega)
        if self.scalings is None:
            return None
        return self.scalings.multipliers(structure, self.omega)

    def __repr__(self) -> str:
        return f"Peak(lower={self.lower:.6g}, upper={self.upper:.6g}, omega={self.omega:.6g} rad/s)"


def peak(
    system: Any,
    structure: Structure,
    tolerance: float = 1e-3,
    *,
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
        Relative distance that the bound may lie above the largest upper bound at any one frequency.
    complex_part
        Complex uncertainty added to every real scalar, as a share of it; see `with_complex_part`.
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
    low, high = band
    if not 0.0 <= low < high:
        raise InputError(f"band is {band}; it must be two frequencies [rad/s], the lower one first")
    original = fitting(system, structure, sampled=True)
    if not isinstance(system, StableSystem):
        warn_far_frequencies(band, system)
    low, high = original.plane(low), original.plane(high)
    if not low < high:
        raise InputError(f"band is {band}; it lies beyond half the sampling rate")
    if complex_part:
        stable, larger = with_complex_part(original, structure, complex_part)
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
        Delta = _summed(Delta, structure, complex_part)
    ends = float(original.angular(low)), float(original.angular(high))
    band = ends if original.period else band
    omega, period = float(original.angular(omega)), original.period
    return Peak(lower, cover.proven, omega, Delta, intervals, message, complex_part, band, period)


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
    # Without G: over frequency these multipliers of real scalars change less.
    real = any(isinstance(block, Real) for block in structure)
    plain = partial(bounds_at, stable, structure.complexified()) if real else None
    cover = BandCover(stable, at, tolerance, found, plain, sweep.holds)
    return cover, cover.complete(steps, most)


def with_complex_part(
    system: Any, structure: Structure, complex_part: float
) -> tuple[StableSystem, Structure]:
    """Add a complex scalar of size `complex_part` to every real scalar of a structure.

    Real scalars delta become delta + complex_part * delta_c. The system and structure returned
    have the added complex blocks last.

    Raises
    ------
    InputError
        `complex_part` is not positive, or there is no real scalar.

    References
    ----------
    Packard, Pandey, Continuity properties of the real/complex structured singular value, IEEE
    Trans. Automatic Control 38 (1993) 415-428.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import with_complex_part
    >>> from workbench.structure import Real, Structure
    >>> system = control.ss(control.tf([0.5], [1.0, 0.2, 1.0]))
    >>> _, structure = with_complex_part(system, Structure([Real(1)]), 0.01)
    >>> len(structure)
    2
    """
    if not (isinstance(complex_part, Number) and 0.0 < complex_part < math.inf):
        raise InputError(
            f"complex_part is {complex_part!r}; it must be a number, positive and finite"
        )
    places = zip(structure, structure.column_slices, structure.row_slices, strict=True)
    real = [(block, column, row) for block, column, row in places if isinstance(block, Real)]
    if not real:
        raise InputError(
            f"the structure {structure.to_pairs()} has no real scalar; leave complex_part out"
        )
    stable = stable_system(system, sampled=True)
    outputs = np.concatenate([np.arange(stable.D.shape[0])[column] for _, column, _ in real])
    inputs = np.concatenate([np.arange(stable.D.shape[1])[row] for _, _, row in real])
    c, r = stable.D.shape
    larger = stable.channels(
        np.concatenate([np.arange(c), outputs]),
        np.concatenate([np.arange(r), inputs]),
        np.concatenate([np.ones(c), np.full(len(outputs), complex_part)]),
    )
    added = [Complex(block.rows, f"{block.name} complex".strip()) for block, _, _ in real]
    return larger, Structure((*structure, *added))


def _summed(Delta: Array, structure: Structure, complex_part: float) -> Array:
    """The perturbation of the original system that equals one of the system with complex parts."""
    whole = Delta[: structure.rows, : structure.columns].copy()
    at = structure.rows, structure.columns
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        if isinstance(block, Real):
            n = block.rows
            whole[row, column] += complex_part * Delta[at[0] : at[0] + n, at[1] : at[1] + n]
            at = at[0] + n, at[1] + n
    return whole
