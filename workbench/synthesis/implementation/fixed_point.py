"""Cascades in fixed-point arithmetic: rounded coefficients, and signals scaled against overflow.

Sections are in direct form I. The memory of a section holds its past inputs and outputs only. The
accumulator is wide enough for the exact sum; only its result is rounded and may overflow.

A last section saturates. If an output has only one channel, full scale of this section is full
scale of the control, so an integrator there neither overflows nor winds up. Saturated second-order
sections do not keep up an oscillation (P. Ebert, J. Mazo, M. Taylor, Overflow oscillations in
digital filters, Bell System Technical Journal 48 (1969) 2999-3020).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import need_whole
from workbench.synthesis.implementation.impulse import absolute_sum, squared_sum
from workbench.synthesis.implementation.sampled_loop import SampledConditions, sampled_conditions
from workbench.synthesis.implementation.second_order import Sections

Integers = NDArray[np.int64]
"""Array of integers."""
ACCUMULATOR_BITS, SPARE_BITS = 63, 4
"""Bits of the widest sum of a computer without its sign, and additional bits for the terms of a
sum.
"""
MOST_ROUNDINGS = 4
"""Largest number of roundings of numerators until their sums fit."""
FEWEST_BITS, MOST_BITS = 4, 62
"""Smallest and largest number of bits of an integer; int64 must hold it."""


@dataclass(frozen=True, eq=False)
class FixedCascade:
    """One channel in integers; signals are integers over 2**(signal_bits - 1), with full scale 1.

    numerators      (L, 3) b0 b1 b2, over 2**numerator_exponents (L,), which include the shifts;
    denominators    (L, 2) a1 a2, over 2**denominator_exponents (L,);
    shifts          (L,): section l gives its output divided by 2**shifts[l];
    largest         (L,): bound of each section's output, with rounding, for inputs up to 1; full
                    scale less a step where the last section saturates;
    noise           standard deviation of the rounding noise at the output of the cascade, in full
                    scales, with the shift undone; the noise of each section counts as white and
                    uniform;
    moved           largest distance by which the rounding of coefficients moves a pole.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import fixed_point, second_order_sections
    >>> cascade = fixed_point(
    ...     second_order_sections(control.tf([0.1], [1.0, -0.9], 0.1)), 24, 32
    ... ).cascades[0][0]
    >>> cascade.moved < 1e-5, cascade.noise < 1e-8
    (True, True)
    """

    numerators: Integers
    numerator_exponents: Integers
    denominators: Integers
    denominator_exponents: Integers
    shifts: Integers
    largest: RealArray
    noise: float
    moved: float

    @property
    def overflow_free(self) -> bool:
        """True if no input within full scale makes a section overflow."""
        return bool((self.largest < 1.0).all())


@dataclass(frozen=True, eq=False)
class FixedPoint:
    """A controller as cascades in integer arithmetic.

    ``cascades[i][j]`` leads from input j to output i; ``quantised`` are the sections with rounded
    coefficients, without shifts.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import fixed_point, second_order_sections
    >>> rounded = fixed_point(second_order_sections(control.tf([0.1], [1.0, -0.9], 0.1)), 8, 16)
    >>> round(float(rounded.lti.poles()[0].real), 4)  # a whole number of 2**-6
    0.8984
    """

    cascades: tuple[tuple[FixedCascade, ...], ...]
    quantised: Sections

    @property
    def overflow_free(self) -> bool:
        """True if no input within full scale makes a section of any channel overflow."""
        return all(cascade.overflow_free for line in self.cascades for cascade in line)

    @property
    def lti(self) -> StateSpace:
        """The controller with the rounded coefficients."""
        return self.quantised.system

    def conditions(
        self, plant: Any, *, delay_samples: float = 0.0, sign: int | None = None
    ) -> SampledConditions:
        """Stability and margins with the rounded coefficients, as from `sampled_conditions`.

        ``delay_samples`` [samples]: how late the control acts.
        """
        system, dt = self.quantised.system, self.quantised.dt
        return sampled_conditions(plant, system, dt, delay_samples=delay_samples, sign=sign)


def fixed_point(sections: Sections, bits: int, signal_bits: int) -> FixedPoint:
    """Round sections to coefficients of `bits` and signals of `signal_bits`, signs included.

    The output of each section is shifted by the least power of two that its worst case needs: the
    sum of the absolute impulse responses from the input, and from all roundings, to this output (L.
    Jackson, On the interaction of roundoff noise and dynamic range in digital filters, Bell System
    Technical Journal 49 (1970) 159-184). The last section of an output with one channel is shifted
    at most to full scale of the control. For other sections no shift suffices if a pole is on the
    unit circle, or if rounding errors add up to more than full scale; ``largest`` is then infinite
    and ``overflow_free`` is False.

    Raises
    ------
    InputError
        A number of bits is not between 4 and 62.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import fixed_point, second_order_sections
    >>> rounded = fixed_point(second_order_sections(control.tf([0.1], [1.0, -0.9], 0.1)), 24, 32)
    >>> rounded.overflow_free
    True
    """
    need_bits(bits, "bits")
    need_bits(signal_bits, "signal_bits")
    found = [
        [_cascade(rows, bits, signal_bits, len(line) == 1) for rows in line]
        for line in sections.channels
    ]
    cascades = tuple(tuple(cascade for cascade, _ in line) for line in found)
    quantised = tuple(tuple(rows for _, rows in line) for line in found)
    return FixedPoint(cascades, Sections(quantised, sections.dt))


def need_bits(value: Any, name: str) -> None:
    """Raise InputError unless a number of bits is possible in this arithmetic."""
    need_whole(value, name)
    if not FEWEST_BITS <= value <= MOST_BITS:
        raise InputError(f"{name} is {value}; it must lie between {FEWEST_BITS} and {MOST_BITS}")


def _cascade(
    rows: RealArray, bits: int, signal_bits: int, alone: bool
) -> tuple[FixedCascade, RealArray]:
    """The cascade in integers, and the sections (L, 6) with the rounded coefficients.

    ``alone`` is True if no other channel leads to the output.
    """
    # Poles near zero need no finer steps than other poles.
    a, a_exponents = _rounded_integers(rows[:, 4:], bits, np.full(len(rows), bits))
    rounded = rows.copy()
    rounded[:, 4:] = a * np.exp2(-a_exponents)[:, None]
    # The finest term determines the length of a sum, so numerators are made only as fine as fits.
    finest = np.full(len(rows), np.iinfo(np.int64).max)
    for _ in range(MOST_ROUNDINGS):
        b, b_exponents = _rounded_integers(rows[:, :3], bits, finest)
        rounded[:, :3] = b * np.exp2(-b_exponents)[:, None]
        shifts, largest = _shifts(rounded, signal_bits, alone)
        moved_by = np.diff(shifts, prepend=0)
        most = a_exponents + ACCUMULATOR_BITS - SPARE_BITS - bits - signal_bits - moved_by
        if (b_exponents <= most).all() or bits + signal_bits + SPARE_BITS > ACCUMULATOR_BITS:
            break
        finest = np.minimum(finest, most)
    # The exponent of a numerator includes the shift, so that no coefficient changes.
    b_exponents = b_exponents + moved_by
    noise = _noise(rounded, shifts, signal_bits)
    moved = _largest_pole_shift(rows, rounded)
    return FixedCascade(b, b_exponents, a, a_exponents, shifts, largest, noise, moved), rounded


def _rounded_integers(
    values: RealArray, bits: int, finest: Integers | None = None
) -> tuple[Integers, Integers]:
    """Integers of magnitude below 2**(bits - 1), and the largest possible exponent of each row.

    No exponent is above `finest`.
    """
    limit = 2.0 ** (bits - 1) - 1
    size = np.abs(values).max(axis=1)
    safe = np.where(size > 0.0, size, limit)
    exponents = np.floor(np.log2(limit / safe)).astype(np.int64)
    if finest is not None:
        exponents = np.minimum(exponents, finest)
    return np.rint(values * np.exp2(exponents)[:, None]).astype(np.int64), exponents


def _shifts(rows: RealArray, signal_bits: int, alone: bool) -> tuple[Integers, RealArray]:
    """The least shifts with which outputs and their rounding errors stay below full scale.

    The last section of a channel that is ``alone`` stays within full scale of the control without a
    shift.
    """
    step = 2.0 ** (1 - signal_bits)
    shifts, largest = np.zeros(len(rows), dtype=np.int64), np.zeros(len(rows))
    for k in range(len(rows)):
        signal = absolute_sum(rows[: k + 1])
        errors = (
            step / 2 * np.array([absolute_sum(_sections_between(rows, j, k)) for j in range(k + 1)])
        )
        room = 1.0 - step - errors[k]  # no shift reduces a section's own errors
        before = signal + float((errors[:k] * np.exp2(shifts[:k])).sum())
        if not (math.isfinite(before) and room > 0.0):
            shifts[k], largest[k] = shifts[k - 1] if k else 0, math.inf
            continue
        shifts[k] = math.ceil(math.log2(before / room)) if before > 0.0 else 0
        largest[k] = before * 2.0 ** -int(shifts[k]) + errors[k]
    if alone and np.isfinite(largest[:-1]).all() and (shifts[-1] > 0 or largest[-1] == math.inf):
        shifts[-1], largest[-1] = 0, 1.0 - step
    return shifts, largest


def _noise(rows: RealArray, shifts: Integers, signal_bits: int) -> float:
    """Standard deviation of the rounding noise at the output in full scales, with the shift
    undone.
    """
    step, last = 2.0 ** (1 - signal_bits), len(rows) - 1
    gains = np.array([squared_sum(_sections_between(rows, j, last)) for j in range(len(rows))])
    return float(np.sqrt((step**2 / 12.0 * gains * 4.0**shifts).sum()))


def _sections_between(rows: RealArray, first: int, last: int) -> RealArray:
    """The sections between a rounding error in section `first` and the output of `last`."""
    through = rows[first : last + 1].copy()
    through[0, :3] = 1.0, 0.0, 0.0
    return through


def _largest_pole_shift(rows: RealArray, rounded: RealArray) -> float:
    """Largest distance by which rounding of coefficients moves a pole.

    Poles before and after rounding are paired so that the distances are smallest.
    """
    largest = 0.0
    for one, other in zip(rows, rounded, strict=True):
        before, after = np.roots(one[3:]), np.roots(other[3:])
        straight, crossed = np.abs(before - after).max(), np.abs(before - after[::-1]).max()
        largest = max(largest, float(min(straight, crossed)))
    return largest
