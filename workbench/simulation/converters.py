"""Converters between volts and codes, which round and saturate."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench._core.compiled import compiled, kernel
from workbench.errors import InputError


@dataclass(frozen=True)
class Converter:
    """Converter with the range +-limit [V] and 2^bits codes; with bits = None it only saturates.

    Codes are two's complement, so the highest level is one step below +limit. Raises InputError if
    the limit or the number of bits is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.simulation import Converter
    >>> adc = Converter(limit=1.0, bits=3)
    >>> adc.step, adc.convert(np.array([0.3, 5.0]))[0].tolist()
    (0.25, [0.25, 0.75])
    """

    limit: float
    _: KW_ONLY
    bits: int | None = 12

    def __post_init__(self) -> None:
        if not self.limit > 0.0 or (self.bits is not None and self.bits < 1):
            raise InputError(f"+-{self.limit} V and {self.bits} bits; both must be positive")

    @property
    def step(self) -> float:
        """Voltage step [V] between codes; 0 without codes."""
        return 0.0 if self.bits is None else 2.0 * self.limit / 2**self.bits

    def levels(self, *, gain: float = 1.0) -> RealArray:
        """Step, lowest and highest level (3,), divided by the gain of an amplifier before it."""
        return np.array([self.step, -self.limit, self.limit - self.step]) / gain

    def convert(self, values: ArrayLike, *, gain: float = 1.0) -> tuple[RealArray, float]:
        """Converted values, in the same shape, and the share of values that saturated."""
        array = np.ascontiguousarray(values, float)
        converted, saturated = _convert_all(array.ravel(), self.levels(gain=gain))
        return converted.reshape(array.shape), saturated / max(array.size, 1)


@kernel
def convert(value: float, step: float, lowest: float, highest: float) -> tuple[float, bool]:
    """Converted value, and whether it saturated, for a converter with given levels."""
    if step > 0.0:
        value = step * np.floor(value / step + 0.5)  # math.floor would pass through an integer
    # Half a step of tolerance, so that rounding of the products does not count as saturation.
    if value < lowest - 0.5 * step:
        return lowest, True
    if value > highest + 0.5 * step:
        return highest, True
    return value, False


@compiled
def _convert_all(values: RealArray, levels: RealArray) -> tuple[RealArray, int]:
    """Converted values (N,), and the number of values that saturated."""
    converted, saturated = np.empty_like(values), 0
    for k, value in enumerate(values):
        converted[k], over = convert(value, levels[0], levels[1], levels[2])
        saturated += over
    return converted, saturated
