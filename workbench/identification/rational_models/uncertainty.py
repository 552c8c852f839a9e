"""Covariance of a fitted rational model: of its response at any frequency, its poles, its delay."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import null_space

from workbench._core.arrays import ComplexArray, RealArray
from workbench.identification.rational_models.model import CommonPoleModel, variable
from workbench.identification.rational_models.point import FitPoint
from workbench.identification.rational_models.residual_tests import (
    disc_radius,
    spread_factor,
    two_sided_normal,
)
from workbench.identification.rational_models.steps import UNSEEN, held_rows
from workbench.identification.rational_models.structure import ModelStructure


@dataclass(frozen=True, eq=False)
class ModelUncertainty:
    """Asymptotic normal distribution of the estimates about a fitted model.

    Coordinates are the numerators and the change of the denominator in the basis of the fit. A pole
    at the margin of stability, or a delay at an end of its range, counts as known. The variance
    does not contain errors of the model structure.

    Parameters
    ----------
    structure, model
        Structure and data of the fit, and the fitted model.
    degrees
        Degrees of freedom of the variance of the data.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import ResponseEstimate, fit_rational_model
    >>> rng, frequency = np.random.default_rng(0), np.geomspace(0.05, 5, 60)
    >>> exact = 3.0 / (2j * np.pi * frequency + 2.0)
    >>> noise = 1e-3 * rng.standard_normal((60, 2)) @ [1, 1j]
    >>> variance = np.full((60, 1, 1), 2e-6)
    >>> measured = ResponseEstimate(frequency, (exact + noise)[:, None, None], variance, np.inf)
    >>> uncertainty = fit_rational_model(measured, orders=1, excess=1).uncertainty
    >>> bool(uncertainty.radius([1.0], confidence=0.95).max() < 0.01)
    True
    """

    structure: ModelStructure
    model: CommonPoleModel
    _: KW_ONLY
    degrees: float = np.inf

    @cached_property
    def point(self) -> FitPoint:
        """The model as a point of the fit: its poles, and its delay minus the known one."""
        extra = float(np.mean(self.model.delay - self.structure.delay))
        return FitPoint(self.structure, self.model.poles / self.structure.unit, extra)

    @cached_property
    def root(self) -> RealArray:
        """A matrix (P, k) with covariance = root root^T, in coordinates of `_slopes`."""
        structure = self.structure
        slopes = structure.data.whitened(self._slopes(structure.data.omega))
        rows = np.concatenate([slopes.real, slopes.imag]).reshape(-1, slopes.shape[-1])
        held = held_rows(self.point)
        free = np.eye(rows.shape[1])
        if held.size:
            padded = np.zeros((len(held), rows.shape[1]))
            padded[:, rows.shape[1] - held.shape[1] :] = held
            free = null_space(padded)
        reduced = rows @ free
        size = np.linalg.norm(reduced, axis=0)
        size[size == 0] = 1.0
        _, s, Vt = np.linalg.svd(reduced / size, full_matrices=False)
        # directions that the data do not determine have a huge variance
        s = np.maximum(s, UNSEEN * s.max(initial=0.0))
        together = 1 if structure.data.independent else structure.data.response[0].size
        factor = np.sqrt(spread_factor(self.degrees, together))
        found: RealArray = free @ (Vt.T / s / size[:, None]) * factor
        return found

    def _slopes(self, omega: RealArray) -> ComplexArray:
        """Derivatives (F, p, m, P) of the response with respect to the coordinates."""
        structure, point = self.structure, self.point
        p, m = self.model.shape
        n = point.poles.size
        basis = point.basis.at(variable(omega / structure.unit, structure.sample_time))
        turn = np.exp(-1j * omega[:, None, None] * self.model.delay)
        values = np.empty((omega.size, p, m), complex)
        blocks = []
        for (i, j), share in point.each_share():
            block = np.zeros((omega.size, p, m, share.size), complex)
            block[:, i, j] = turn[:, i, j, None] * basis[:, : share.size]
            values[:, i, j] = block[:, i, j] @ share
            blocks.append(block)
        blocks.append(-values[..., None] * basis[:, None, None, :n])
        if structure.free_delay:
            blocks.append((-1j * omega[:, None, None] * values)[..., None])
        return np.concatenate(blocks, axis=-1)

    def response_covariance(self, omega: ArrayLike) -> RealArray:
        """Covariance (F, p, m, 2, 2) of real and imaginary part of each entry at omega [rad/s]."""
        omega = np.atleast_1d(np.asarray(omega, float))
        slopes = self._slopes(omega) @ self.root
        parts = np.stack([slopes.real, slopes.imag], axis=-2)
        found: RealArray = parts @ parts.swapaxes(-1, -2)
        return found

    def radius(
        self, omega: ArrayLike, *, confidence: float = 0.95, everywhere: bool = False
    ) -> RealArray:
        """Radius (F, p, m) of a disc about each entry that contains the true one.

        ``confidence`` is the least probability of that for each disc at one frequency or, if
        ``everywhere``, for all entries and all frequencies simultaneously.
        """
        dimension = self.root.shape[1] if everywhere else 2
        return disc_radius(self.response_covariance(omega), confidence, dimension)

    def magnitude_band(self, omega: ArrayLike, *, confidence: float = 0.95) -> RealArray:
        """Half-widths (F, p, m) of intervals of the magnitudes, to first order."""
        return two_sided_normal(confidence) * self._along(omega, 1.0)

    def phase_band(self, omega: ArrayLike, *, confidence: float = 0.95) -> RealArray:
        """Half-widths (F, p, m) [rad] of intervals of the phases, to first order."""
        values = self.model.response(np.atleast_1d(np.asarray(omega, float)))
        return two_sided_normal(confidence) * self._along(omega, 1j) / np.abs(values)

    def _along(self, omega: ArrayLike, turn: complex) -> RealArray:
        """Standard deviations (F, p, m) along the response, rotated by a factor of modulus 1."""
        values = turn * self.model.response(np.atleast_1d(np.asarray(omega, float)))
        unit = values / np.maximum(np.abs(values), 1e-300)
        way = np.stack([unit.real, unit.imag], axis=-1)
        square = np.einsum("...a,...ab,...b->...", way, self.response_covariance(omega), way)
        found: RealArray = np.sqrt(square)
        return found

    def pole_covariance(self) -> RealArray:
        """Covariance (n, 2, 2) of the two parts of each pole; NaN if poles coincide.

        For a pole on the real axis only the real part varies, to first order.
        """
        n, point = self.model.order, self.point
        last = self.root.shape[0] - self.structure.free_delay
        slopes = point.basis.pole_slopes() @ self.root[last - n : last] * self.structure.unit
        parts = np.stack([slopes.real, slopes.imag], axis=1)
        found: RealArray = parts @ parts.swapaxes(1, 2)
        return np.where(np.isfinite(found), found, np.nan)

    def delay_deviation(self) -> float:
        """Standard deviation [s] of a fitted delay; 0 if none is fitted."""
        if not self.structure.free_delay:
            return 0.0
        return float(np.linalg.norm(self.root[-1]))

    def drawn(self, rng: np.random.Generator, omega: ArrayLike, count: int) -> ComplexArray:
        """Responses (count, F, p, m) of models drawn from the distribution, to first order."""
        omega = np.atleast_1d(np.asarray(omega, float))
        slopes = self._slopes(omega) @ self.root
        change = rng.standard_normal((count, slopes.shape[-1]))
        return self.model.response(omega) + np.einsum("fpmk,ck->cfpm", slopes, change)
