"""Cascades in integers: coefficients rounded, signals scaled so that nothing overflows.

Sections are in direct form I with one accumulator, wide enough for the sum, whose result alone is
rounded and may overflow: a section's memory holds past inputs and outputs and nothing else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import RealArray
from workbench.errors import InputError
from workbench.synthesis.implementation.impulse import absolute_sum, squared_sum
from workbench.synthesis.implementation.sampled_loop import SampledConditions, sampled_conditions
from workbench.synthesis.implementation.second_order import Sections

Integers = NDArray[np.int64]
FEWEST, MOST = 4, 62
"""Bits of an integer: of what int64 holds."""


@dataclass(frozen=True, eq=False)
class FixedCascade:
    """One channel in integers; signals are integers over 2**(signal_bits - 1), full scale 1.

    numerators      (L, 3) b0 b1 b2, over 2**numerator_exponents (L,), which take in the shifts;
    denominators    (L, 2) a1 a2, over 2**denominator_exponents (L,);
    shifts          (L,): section l puts out its output over 2**shifts[l];
    largest         (L,): bound of what it puts out, rounding included, for inputs up to 1;
    noise           standard deviation of the rounding at the end, shift undone, full scale 1: each
                    section's is taken as white and uniform;
    moved           largest distance by which the rounding of coefficients moves a pole.
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
        """Whether no input up to full scale makes a section overflow."""
        return bool((self.largest < 1.0).all())


@dataclass(frozen=True, eq=False)
class FixedPoint:
    """``cascades[i][j]`` from input j to output i; ``quantised`` are their values, unshifted."""

    cascades: tuple[tuple[FixedCascade, ...], ...]
    quantised: Sections

    @property
    def overflow_free(self) -> bool:
        return all(cascade.overflow_free for line in self.cascades for cascade in line)

    def conditions(self, plant: Any, delay: float = 0.0, *, sign: int = -1) -> SampledConditions:
        """As `sampled_conditions`, of the loop with the rounded coefficients."""
        system, dt = self.quantised.system, self.quantised.dt
        return sampled_conditions(plant, system, dt, delay, sign=sign)


def fixed_point(sections: Sections, bits: int, signal_bits: int) -> FixedPoint:
    """Coefficients of `bits` and signals of `signal_bits`, signs included, with the least shifts.

    Each section's output is shifted by the power of two that its worst case needs: the sum of
    the absolute impulse response from the input to it, and of those of all roundings (L. Jackson,
    On the interaction of roundoff noise and dynamic range in digital filters, Bell System Technical
    Journal 49 (1970) 159-184). Where no shift does, for a pole on the unit circle or roundings that
    add up beyond full scale, ``largest`` is infinite and ``overflow_free`` false.

    Raises
    ------
    InputError
        Bits that are not between 4 and 62.
    """
    for name, value in (("bits", bits), ("signal_bits", signal_bits)):
        if not FEWEST <= value <= MOST:
            raise InputError(f"{name} is {value}; it must lie between {FEWEST} and {MOST}")
    found = [[_cascade(rows, bits, signal_bits) for rows in line] for line in sections.channels]
    cascades = tuple(tuple(cascade for cascade, _ in line) for line in found)
    quantised = tuple(tuple(rows for _, rows in line) for line in found)
    return FixedPoint(cascades, Sections(quantised, sections.dt))


def _cascade(rows: RealArray, bits: int, signal_bits: int) -> tuple[FixedCascade, RealArray]:
    """The integers, and the sections that they stand for."""
    a, a_exponents = _rounded(rows[:, 4:], bits)
    b, b_exponents = _rounded(rows[:, :3], bits)
    rounded = rows.copy()
    rounded[:, 4:] = a * np.exp2(-a_exponents)[:, None]
    rounded[:, :3] = b * np.exp2(-b_exponents)[:, None]
    shifts, largest = _shifts(rounded, signal_bits)
    # A shift is in the exponent of a numerator, so that it changes no coefficient.
    b_exponents = b_exponents + np.diff(shifts, prepend=0)
    noise = _noise(rounded, shifts, signal_bits)
    moved = _moved(rows, rounded)
    return FixedCascade(b, b_exponents, a, a_exponents, shifts, largest, noise, moved), rounded


def _rounded(values: RealArray, bits: int) -> tuple[Integers, Integers]:
    """Integers below 2**(bits - 1) in size and the exponent of each row, as fine as fits."""
    limit = 2.0 ** (bits - 1) - 1
    size = np.abs(values).max(axis=1)
    safe = np.where(size > 0.0, size, limit)
    exponents = np.floor(np.log2(limit / safe)).astype(np.int64)
    return np.rint(values * np.exp2(exponents)[:, None]).astype(np.int64), exponents


def _shifts(rows: RealArray, signal_bits: int) -> tuple[Integers, RealArray]:
    """The least shifts with which outputs and their rounding errors stay below full scale."""
    step = 2.0 ** (1 - signal_bits)
    shifts, largest = np.zeros(len(rows), dtype=np.int64), np.zeros(len(rows))
    for k in range(len(rows)):
        signal = absolute_sum(rows[: k + 1])
        errors = step / 2 * np.array([absolute_sum(_after(rows, j, k)) for j in range(k + 1)])
        room = 1.0 - step - errors[k]  # no shift makes a section's own errors smaller
        before = signal + float((errors[:k] * np.exp2(shifts[:k])).sum())
        if not (math.isfinite(before) and room > 0.0):
            shifts[k], largest[k] = shifts[k - 1] if k else 0, math.inf
            continue
        shifts[k] = math.ceil(math.log2(before / room)) if before > 0.0 else 0
        largest[k] = before * 2.0 ** -int(shifts[k]) + errors[k]
    return shifts, largest


def _noise(rows: RealArray, shifts: Integers, signal_bits: int) -> float:
    step, last = 2.0 ** (1 - signal_bits), len(rows) - 1
    gains = np.array([squared_sum(_after(rows, j, last)) for j in range(len(rows))])
    return float(np.sqrt((step**2 / 12.0 * gains * 4.0**shifts).sum()))


def _after(rows: RealArray, first: int, last: int) -> RealArray:
    """What a rounding in section `first` goes through up to the output of section `last`."""
    through = rows[first : last + 1].copy()
    through[0, :3] = 1.0, 0.0, 0.0
    return through


def _moved(rows: RealArray, rounded: RealArray) -> float:
    """Poles of a section are matched in the way that moves them least."""
    largest = 0.0
    for one, other in zip(rows, rounded, strict=True):
        before, after = np.roots(one[3:]), np.roots(other[3:])
        straight, crossed = np.abs(before - after).max(), np.abs(before - after[::-1]).max()
        largest = max(largest, float(min(straight, crossed)))
    return largest
