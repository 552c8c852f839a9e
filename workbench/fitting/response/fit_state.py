"""A rational function in the search for the least worst error: its errors and their derivatives."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.fitting.factored import FactoredRational
from workbench.fitting.response.program import ResponseFit


class FitState:
    """A fit given by its parameters (P,), with the weighted errors (F,) and their peak."""

    def __init__(self, program: ResponseFit, form: FactoredRational, vector: RealArray) -> None:
        data = program.active
        self.program, self.form, self.vector = program, form, vector
        self._values, self._slopes = form.values(vector, data.omega)
        self.error = data.weight * (self._values - data.response)
        peak = float(np.abs(self.error).max())
        self.peak = peak if np.isfinite(peak) else np.inf

    def moved(self, step: RealArray) -> FitState:
        """The state after a step (P,)."""
        return FitState(self.program, self.form, self.vector + step)

    @cached_property
    def slopes(self) -> ComplexArray:
        """Derivatives (F, P) of the weighted errors with respect to the parameters."""
        slopes: ComplexArray = self.program.active.weight[:, None] * self._slopes
        return slopes

    def square(self, weight: RealArray) -> float:
        """Sum of squared errors, each multiplied by a weight (F,) before squaring."""
        return float(np.sum(np.abs(weight * self.error) ** 2))

    def curvature(self, factor: ComplexArray) -> RealArray:
        """Second derivatives (P, P) of the sum of Re(factor * error), for given factors (F,).

        Second derivatives are left out where the function is zero.
        """
        factor = factor * self.program.active.weight
        ratio = np.divide(factor, self._values, out=np.zeros_like(factor), where=self._values != 0)
        factors, logarithmic = self.form.second_order
        scaled, slopes = self._slopes * ratio[:, None], self._slopes
        left = np.concatenate([scaled.real, -scaled.imag])
        matrix: RealArray = factors * (left.T @ np.concatenate([slopes.real, slopes.imag]))
        matrix[np.diag_indices_from(matrix)] += logarithmic * (factor @ self._slopes).real
        return matrix

    @property
    def natural_units(self) -> RealArray:
        """Changes (P,) of the parameters that count as large: 1, but for the gain its own size."""
        size = np.abs(self.vector)
        units = np.where(self.form.second_order[1], 1.0, np.maximum(size, 1.0))
        units[-1] = size[-1] or 1.0
        return units
