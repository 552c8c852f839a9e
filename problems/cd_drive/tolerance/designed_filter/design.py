"""The fault filter with stability margins: its limits, and the reached part of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.diagnosis import (
    DemandReached,
    FaultFront,
    FaultLoop,
    FrontFilter,
    LaguerreBasis,
    best_design,
    low_order_filter,
)
from workbench.errors import SolverError

from ...diagnosis.fault_filter.loop import LAGUERRE_POLE, fine_grid, grid
from ...diagnosis.fault_filter.problem import SAMPLED

Limits = tuple[float, float, float]
"""Relative error, leakage [m], and sensitivity while a defect passes."""


@dataclass(frozen=True, eq=False)
class MarginsDesign:
    """Filters of low order that bound error, leakage and sensitivity for every plant of a loop."""

    loop: FaultLoop
    asked: Limits
    order: int

    def best(self) -> tuple[DemandReached, FrontFilter]:
        """The reached part of the asked limits, and the filter with least leakage and noise
        there.
        """
        return best_design([self.loop], self._least_factor, self._designed)

    def limits(self, reached: DemandReached) -> Limits:
        """The limits that are reached."""
        error, leakage, peak = (reached.factor * one for one in self.asked)
        return error, leakage, peak

    def front(self, share: float) -> FaultFront:
        """The front around this share of the set."""
        return FaultFront(self.loop.within(share), grid(self.loop))

    def on_front(self, share: float, error: float, peak: float) -> list[float]:
        """Error, leakage and noise [m], and sensitivity, at a point of the front; NaN if no filter
        exists.
        """
        front = self.front(share)
        basis = LaguerreBasis(self.loop, LAGUERRE_POLE).response(front.omega, SAMPLED)
        try:
            one = front.least(basis, error, peak=peak)
        except SolverError:
            return [np.nan] * 4
        size = front.removed_peak(basis @ one.coefficients)
        return [one.error, one.leakage, one.noise, size]

    def _least_factor(self, reached: DemandReached) -> float:
        """Least factor on the limits that filters of full order reach."""
        front = self.front(reached.share)
        basis = LaguerreBasis(self.loop, LAGUERRE_POLE).response(front.omega, SAMPLED)
        error, leakage, peak = self.limits(reached)
        return front.least_factor(basis, error, leakage, peak=peak)

    def _designed(self, reached: DemandReached) -> FrontFilter | None:
        """The filter of low order with the least noise within the limits; None if there is none."""
        front = self.front(reached.share)
        error, leakage, peak = self.limits(reached)
        basis = LaguerreBasis(front.loop, LAGUERRE_POLE)
        try:
            functions = basis.response(front.omega, SAMPLED)
            point = front.least(functions, error, leakage=leakage, peak=peak)
            full, points = basis.filter(point.coefficients), fine_grid(front.loop)
            few = low_order_filter(front.loop, points, full, self.order, error, leakage, peak=peak)
        except SolverError:  # its least leakage is larger than the limit
            return None
        return few if few.meets else None
