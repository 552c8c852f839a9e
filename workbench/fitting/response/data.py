"""Data of a response fit."""

from __future__ import annotations

from dataclasses import dataclass

from workbench._core.arrays import ComplexArray, RealArray


@dataclass(frozen=True)
class Data:
    """Frequencies [rad/s], responses and positive weights, each (F,)."""

    omega: RealArray
    response: ComplexArray
    weight: RealArray
