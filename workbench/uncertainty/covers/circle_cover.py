"""Uncertainty models with a complex weight: circles around a nominal (thesis, section 5.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.geometry import NarrowestStadium, SmallestCircle, Stadium
from workbench.uncertainty.covers.cover import UncertaintyCover
from workbench.uncertainty.covers.sets import circles_about_nominal


@dataclass(frozen=True, eq=False)
class CircleCover(UncertaintyCover):
    """G (1 + W_c delta_c): a nominal and a complex weight that contain every response."""

    shape: ClassVar[Literal["circle", "stadium"]] = "circle"
    headline: ClassVar[str] = "radius_peak"
    size_name: ClassVar[str] = "radius"

    def first_program(self, points: ComplexArray) -> SmallestCircle:
        return SmallestCircle(points)

    def second_set(self, away: ComplexArray) -> Stadium:
        return circles_about_nominal(away)

    def third_set(self, away: ComplexArray, W_r: Rational | None = None) -> Stadium:
        return self.second_set(away)

    def real_weight(self, third: Stadium, context: Context) -> None:
        return None

    def least_radius(self, sets: NarrowestStadium, second: Stadium) -> RealArray:
        return np.abs(sets.points).max(axis=1)
