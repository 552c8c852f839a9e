"""Regressors, instruments and estimates for a record whose signals pass one filter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft
from scipy.ndimage import uniform_filter1d

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.transfer_functions.estimate import TransferFunctionEstimate
from workbench.identification.transfer_functions.filters import DerivativeFilter
from workbench.identification.transfer_functions.record import SampledRecord
from workbench.input_checks import as_list, need_whole

SINGULAR = 1e-13
"""Reciprocal condition number of the normal equations below which the data do not determine the
coefficients.
"""
COEFFICIENT_ROUNDING = 1e-9
"""Least standard deviation of a coefficient, relative to the largest one, in the filter's units."""


@dataclass(frozen=True, eq=False)
class FilteredRecord:
    """A record seen through a filter 1 / F, as a linear regression of the model's coefficients.

    Coefficients theta are in the filter's unit of frequency; `units` converts them to powers of s.
    """

    record: SampledRecord
    degrees: tuple[int, int]
    filter: DerivativeFilter

    @classmethod
    def of(
        cls, record: SampledRecord, degrees: tuple[int, int], denominator: ArrayLike
    ) -> FilteredRecord:
        if len(as_list(degrees, "degrees")) != 2:
            raise InputError(f"degrees are {degrees}; give two: the numerator's, the denominator's")
        for one in degrees:
            need_whole(one, "each of the degrees")
        m, n = degrees
        if not 0 <= m <= n:
            raise InputError(
                f"degrees are {degrees}; the numerator's may not exceed the denominator's"
            )
        filter_ = np.asarray(denominator, float)
        if filter_.shape != (n + 1,) or filter_[0] != 1.0 or not np.isfinite(filter_).all():
            raise InputError(
                f"the filter needs a monic polynomial of degree {n}, not {filter_.tolist()}"
            )
        if np.roots(filter_).real.max() >= 0.0:
            raise InputError(f"the filter has a root at {np.roots(filter_).real.max():g} rad/s")
        if len(record.u) <= m + n + 1:
            raise InputError(f"{len(record.u)} samples cannot tell {m + n + 1} coefficients")
        return cls(record, degrees, DerivativeFilter(filter_, record.dt))

    @classmethod
    def at(
        cls, record: SampledRecord, degrees: tuple[int, int], values: RealArray
    ) -> FilteredRecord:
        """The model whose filter is its own denominator."""
        return cls.of(record, degrees, np.append(1.0, values[degrees[0] + 1 :]))

    @cached_property
    def units(self) -> RealArray:
        """Ratios of coefficients in powers of s to those in the filter's unit of frequency."""
        m, n = self.degrees
        found: RealArray = self.filter.rate ** np.concatenate(
            [n - np.arange(m, -1, -1.0), np.arange(1.0, n + 1)]
        )
        return found

    @cached_property
    def _by_input(self) -> RealArray:
        return self._numerator(self.record.u)

    def _numerator(self, u: RealArray) -> RealArray:
        """Filtered derivatives (N, m + 1) of an input: p^m / F u ... 1 / F u."""
        filtered = self.filter.derivatives(u, self.record.hold)
        return filtered[:, self.degrees[0] :: -1]

    def regressors(self) -> tuple[RealArray, RealArray]:
        """phi (N, m + 1 + n) and p^n / F y (N,)."""
        filtered = self.filter.derivatives(self.record.y, "first-order")
        return np.hstack([self._by_input, -filtered[:, -2::-1]]), filtered[:, -1]

    def instruments(self, values: RealArray, u: RealArray) -> tuple[RealArray, RealArray]:
        """phi (N, m + 1 + n) of the noise-free output, and that output (N,)."""
        by_input = self._by_input if u is self.record.u else self._numerator(u)
        output = by_input @ (values / self.units)[: self.degrees[0] + 1]
        filtered = self.filter.derivatives(output, "first-order")
        return np.hstack([by_input, -filtered[:, -2::-1]]), output

    def estimate(
        self,
        theta: RealArray,
        pair: tuple[RealArray, RealArray],
        error: RealArray,
        iterations: int,
    ) -> TransferFunctionEstimate:
        """The estimate that solves sum z (error) = 0; z and phi are given as a pair."""
        z, phi = pair
        inverse = np.linalg.inv(z.T @ phi) * self.units[:, None]
        values = theta * self.units
        m = self.degrees[0]
        return TransferFunctionEstimate(
            numerator=values[: m + 1],
            denominator=np.append(1.0, values[m + 1 :]),
            covariance=inverse @ _scatter(z, error) @ inverse.T,
            noise=float(np.sqrt(error @ error / (len(error) - len(theta)))),
            iterations=iterations,
        )


def _scatter(z: RealArray, error: RealArray) -> RealArray:
    """Covariance of sum z (error) for errors with the spectrum of the given ones (N,)."""
    samples = len(error)
    length = fft.next_fast_len(samples, real=True)
    power = np.abs(fft.rfft(error, length)) ** 2 / samples
    smooth = uniform_filter1d(power, 2 * math.ceil(samples ** (1 / 3)) + 1, mode="mirror")
    spectra = fft.rfft(z, length, axis=0) * np.sqrt(smooth)[:, None]
    lines = spectra * np.sqrt(np.where(np.arange(len(power)) > 0, 2.0, 1.0))[:, None]
    found: RealArray = (lines.conj().T @ lines).real / length
    return found * samples / (samples - z.shape[1])


def in_deviations(
    change: RealArray, theta: RealArray, cross: RealArray, z: RealArray, error: RealArray
) -> float:
    """Largest change of theta, in the standard deviations that white errors would give.

    Standard deviations below the rounding of the coefficients are replaced by that.
    """
    inverse = np.linalg.inv(cross)
    variance = np.diag(inverse @ (z.T @ z) @ inverse.T) * np.mean(error**2)
    floor = COEFFICIENT_ROUNDING * np.abs(theta).max()
    return float(np.max(np.abs(change) / np.sqrt(variance + floor**2)))


def solved(matrix: RealArray, right: RealArray) -> RealArray:
    """Solution of normal equations; `InputError` if the data do not determine it."""
    scale = np.sqrt(np.abs(np.diag(matrix)))
    unit = matrix / np.outer(scale, scale) if scale.all() else np.zeros_like(matrix)
    if not (np.isfinite(unit).all() and np.linalg.cond(unit) < 1.0 / SINGULAR):
        raise InputError(
            "the record does not tell all coefficients: excite more frequencies, or lower the "
            "degrees"
        )
    found: RealArray = np.linalg.solve(unit, right / scale) / scale
    return found
