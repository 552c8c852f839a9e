"""Data of a response fit."""

from __future__ import annotations

from dataclasses import dataclass

from workbench._core.arrays import ComplexArray, RealArray


@dataclass(frozen=True)
class Data:
    """Frequencies [rad/s], responses and positive weights, each (F,).

    Unlike `FrequencyResponseData`, it has weights, and one channel.
    """

    omega: RealArray
    response: ComplexArray
    weight: RealArray
