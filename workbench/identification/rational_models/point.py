"""A model during the fit: poles and delay, the best numerators for them, and derivatives.

The model is linear in the numerators, so they are eliminated (G. H. Golub and V. Pereyra, SIAM J.
Numer. Anal. 10(2), 1973). The remaining unknowns are the poles; they move by changes of the
denominator in the basis that is orthonormal at the present poles.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.linalg import qr, solve_triangular

from workbench._core.arrays import ComplexArray, RealArray
from workbench.fitting.rational import Rational
from workbench.identification.rational_models.basis import DenominatorBasis
from workbench.identification.rational_models.model import CommonPoleModel
from workbench.identification.rational_models.structure import ModelStructure


class FitPoint:
    """Poles (n,), in units of the structure, and a delay [s] in addition to the known ones."""

    def __init__(self, structure: ModelStructure, poles: ComplexArray, delay: float = 0.0) -> None:
        self.structure, self.poles, self.delay = structure, poles, delay
        data = structure.data
        self.basis = DenominatorBasis.over(structure.x, structure.weight, poles)
        delays = structure.delay + delay
        self.turn: ComplexArray = np.exp(-1j * data.omega[:, None, None] * delays)
        self.shares: list[RealArray] = []
        self._frames: list[RealArray] = []
        target, fitted = data.target, np.zeros(data.target.shape, complex)
        for group in structure.groups:
            columns = self._columns(group)
            Q, R = qr(columns, mode="economic", check_finite=False)
            right = structure.stacked(target, group)
            along = Q.T @ right
            share = solve_triangular(R, along, check_finite=False)
            self._frames.append(Q)
            self.shares.append(share)
            structure.unstack(columns @ share, group, fitted)
        self.fitted = fitted
        self.residual: ComplexArray = fitted - target
        cost = float(np.sum(np.abs(self.residual) ** 2))
        self.cost = cost if np.isfinite(cost) else np.inf

    def _columns(self, group: list[tuple[int, int]]) -> RealArray:
        """Whitened numerator functions of the entries of a group, real above imaginary."""
        structure = self.structure
        data = structure.data
        counts = [structure.degree(i, j, self.poles.size) + 1 for i, j in group]
        if data.independent:
            (i, j), count = group[0], counts[0]
            scale = self.turn[:, i, j] * np.sqrt(2) / data.deviation[:, i, j]
            values = scale[:, None] * self.basis.values[:, :count]
            return np.concatenate([values.real, values.imag])
        blocks = []
        for (i, j), count in zip(group, counts, strict=True):
            block = np.zeros((*data.response.shape, count), complex)
            block[:, i, j] = self.turn[:, i, j, None] * self.basis.values[:, :count]
            blocks.append(data.whitened(block))
        return structure.stacked(np.concatenate(blocks, axis=-1), group)

    @property
    def values(self) -> ComplexArray:
        """Responses (F, p, m) of the model, not whitened."""
        data = self.structure.data
        found = np.empty(data.response.shape, complex)
        for (i, j), share in self.each_share():
            found[:, i, j] = self.turn[:, i, j] * (self.basis.values[:, : share.size] @ share)
        return found

    def each_share(self) -> list[tuple[tuple[int, int], RealArray]]:
        """Numerator coefficients of each entry."""
        found = []
        for group, share in zip(self.structure.groups, self.shares, strict=True):
            place = 0
            for i, j in group:
                count = self.structure.degree(i, j, self.poles.size) + 1
                found.append(((i, j), share[place : place + count]))
                place += count
        return found

    def denominator_slopes(self, values: ComplexArray) -> ComplexArray:
        """Whitened -values q_k / D0 (F, p, m, n), and -s values if the delay is free.

        With the model's values they are its derivatives; with the data they are the regressors of
        a linearised equation error.
        """
        structure, n = self.structure, self.poles.size
        slopes = -values[..., None] * self.basis.values[:, None, None, :n]
        if structure.free_delay:
            s = 1j * structure.data.omega[:, None, None, None]
            slopes = np.concatenate([slopes, -s * values[..., None]], axis=-1)
        return structure.data.whitened(slopes)

    def without_numerators(self, values: ComplexArray) -> RealArray:
        """Whitened values (F, p, m, k) minus their fit by numerators, as (rows, k)."""
        parts = []
        for group, Q in zip(self.structure.groups, self._frames, strict=True):
            rows = self.structure.stacked(values, group)
            parts.append(rows - Q @ (Q.T @ rows))
        return np.concatenate(parts)

    @cached_property
    def slopes(self) -> RealArray:
        """Derivatives of the residuals with numerators eliminated, (rows, n or n + 1)."""
        return self.without_numerators(self.denominator_slopes(self.values))

    @cached_property
    def errors(self) -> RealArray:
        """The residuals in the order of the rows of `slopes`."""
        return np.concatenate(
            [self.structure.stacked(self.residual, group) for group in self.structure.groups]
        )

    def moved(self, change: RealArray) -> FitPoint:
        """The point with a changed denominator (n,) and, if it is free, a changed delay."""
        n = self.poles.size
        poles = self.structure.allowed(self.basis.moved(change[:n]))
        delay = self.delay
        if self.structure.free_delay:
            delay = self.structure.allowed_delay(delay + float(change[n]))
        return FitPoint(self.structure, poles, delay)

    def model(self) -> CommonPoleModel:
        """The model with poles and zeros [rad/s], or in the z-plane."""
        structure = self.structure
        p, m = structure.data.shape
        unit = structure.unit
        poles = self.poles * unit
        entries: list[list[Rational]] = [[None] * m for _ in range(p)]  # type: ignore[list-item]
        for (i, j), share in self.each_share():
            zeros, gain = self.basis.roots(share)
            scaled = gain * unit ** float(self.poles.size - zeros.size)
            entries[i][j] = Rational(zeros * unit, poles, scaled)
        return CommonPoleModel(entries, structure.delay + self.delay, dt=structure.sample_time)
