"""Measured responses with the covariance of their errors, whitened for a fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.fitting.samples import as_frequencies
from workbench.input_checks import as_array

HERMITIAN_ROUNDING = 1e-9
"""Relative distance of a covariance from a Hermitian matrix that counts as rounding."""
LEAST_EIGENVALUE = 1e-12
"""A covariance, scaled to a unit diagonal, counts as singular if an eigenvalue is below this."""


@dataclass(frozen=True, eq=False)
class WeightedResponse:
    """Responses (F, p, m) at omega (F,) [rad/s], and the covariance of their errors.

    Unlike a `ResponseEstimate`, it may have covariances between entries, and it is whitened for
    a fit.

    Parameters
    ----------
    covariance
        Variances E|error|^2 (F, p, m) if the entries have independent errors; or matrices E[error
        error^H] (F, p m, p m) of the entries of each response, row by row.

    Raises
    ------
    InputError
        Other shapes, values that are not finite, or a covariance that is not positive definite.
    """

    omega: Any  # arrays, after construction
    response: Any
    covariance: Any

    def __post_init__(self) -> None:
        omega = as_frequencies(self.omega)
        response = as_array(self.response, "response", dtype=complex)
        if response.shape == omega.shape:
            response = response[:, None, None]
        if response.ndim != 3 or len(response) != omega.size or not np.isfinite(response).all():
            raise InputError(
                f"response must be finite and of shape ({omega.size}, p, m), not {response.shape}"
            )
        covariance = as_array(self.covariance, "covariance", dtype=complex)
        if covariance.shape == omega.shape:
            covariance = covariance[:, None, None]
        count = response[0].size
        if covariance.shape not in (response.shape, (omega.size, count, count)):
            raise InputError(
                f"covariance has shape {covariance.shape}; {response.shape} of variances or "
                f"({omega.size}, {count}, {count}) of matrices is needed"
            )
        _refuse_indefinite(covariance, covariance.shape == response.shape, omega)
        if covariance.shape == response.shape:
            covariance = covariance.real
        for name, value in {"omega": omega, "response": response, "covariance": covariance}.items():
            object.__setattr__(self, name, value)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of outputs and inputs."""
        return self.response.shape[1], self.response.shape[2]

    @property
    def independent(self) -> bool:
        """Whether the errors of the entries are independent of each other."""
        return bool(self.covariance.shape == self.response.shape)

    @property
    def count(self) -> int:
        """Number of real data."""
        return 2 * int(self.response.size)

    @cached_property
    def deviation(self) -> RealArray:
        """Standard deviations sqrt(E|error|^2) (F, p, m)."""
        if self.independent:
            return np.sqrt(self.covariance)
        diagonal = np.einsum("fii->fi", self.covariance).real
        found: RealArray = np.sqrt(diagonal).reshape(self.response.shape)
        return found

    @cached_property
    def _root(self) -> ComplexArray:
        """Inverse Cholesky factors (F, p m, p m), times sqrt 2."""
        factor = np.linalg.cholesky(self.covariance)
        found: ComplexArray = np.sqrt(2) * np.linalg.inv(factor)
        return found

    def whitened(self, values: ComplexArray) -> ComplexArray:
        """Values (F, p, m, ...), scaled so that all errors are independent.

        Real and imaginary part of an error have variance 1.
        """
        if self.independent:
            scale = np.sqrt(2) / self.deviation
            return values * scale.reshape(*scale.shape, *[1] * (values.ndim - 3))
        flat = values.reshape(len(values), self.response[0].size, -1)
        return np.asarray(self._root @ flat).reshape(values.shape)

    @cached_property
    def target(self) -> ComplexArray:
        """The whitened response (F, p, m)."""
        return self.whitened(self.response)

    @cached_property
    def size(self) -> float:
        """Norm of the whitened response."""
        return float(np.linalg.norm(self.target))


def _refuse_indefinite(covariance: ComplexArray, variances: bool, omega: RealArray) -> None:
    """Raise `InputError` unless every covariance is Hermitian positive definite."""
    bad = ~np.isfinite(covariance).all(axis=(1, 2))
    if variances:
        real = np.abs(covariance.imag) <= HERMITIAN_ROUNDING * covariance.real
        bad |= ~((covariance.real > 0) & real).all(axis=(1, 2))
    elif not bad.any():
        diagonal = np.einsum("fii->fi", covariance).real
        bad |= ~(diagonal > 0).all(axis=1)
        scale = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        unit = covariance * scale[:, :, None] * scale[:, None, :]
        bad |= np.abs(unit - unit.conj().swapaxes(1, 2)).max(axis=(1, 2)) > HERMITIAN_ROUNDING
        bad |= np.linalg.eigvalsh(unit)[:, 0] < LEAST_EIGENVALUE
    if bad.any():
        raise InputError(
            f"covariance must be finite and positive definite; at {omega[np.argmax(bad)]:.6g} "
            "rad/s it is not: leave the frequency out, or average more periods"
        )
