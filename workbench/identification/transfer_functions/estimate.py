"""An estimated continuous-time transfer function, with the covariance of its coefficients."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import TransferFunction


@dataclass(frozen=True, eq=False)
class TransferFunctionEstimate:
    """B(s) / A(s), coefficients in descending powers of s.

    Unlike a `TransferFunction`, it has the covariance of its coefficients.

    Parameters
    ----------
    numerator
        B, shape (m + 1,).
    denominator
        A, shape (n + 1,), monic.
    covariance
        Covariance of (B, A without its leading 1), shape (m + 1 + n, m + 1 + n).
    noise
        Root mean square of the output's error.
    iterations
        Number of iterations made.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import SampledRecord, filtered_least_squares
    >>> time = np.arange(2000) * 0.05
    >>> u = np.sign(np.sin(time**1.3))
    >>> y = control.forced_response(control.tf([3.0], [1.0, 2.0]), time, u).outputs
    >>> record = SampledRecord(u, y, dt=1 / 20.0, hold="first-order")
    >>> found = filtered_least_squares(record, degrees=(0, 1), denominator=[1.0, 3.0])
    >>> round(float(abs(found.response([0.0])[0])), 2), found.covariance.shape
    (1.5, (2, 2))
    """

    numerator: RealArray
    denominator: RealArray
    covariance: RealArray
    noise: float
    _: KW_ONLY
    iterations: int = 0

    @property
    def values(self) -> RealArray:
        """Free coefficients (m + 1 + n,): B, then A without its leading 1."""
        return np.append(self.numerator, self.denominator[1:])

    @property
    def deviations(self) -> RealArray:
        """Standard deviations of `values`."""
        found: RealArray = np.sqrt(np.diag(self.covariance))
        return found

    @property
    def lti(self) -> TransferFunction:
        """As `system`."""
        return self.system()

    def system(self) -> TransferFunction:
        """The transfer function of python-control."""
        import control

        return control.tf(self.numerator, self.denominator)

    def response(self, cycles_per_sample: ArrayLike) -> ComplexArray:
        """Response (F,) at frequencies [Hz] (F,)."""
        s = 2j * np.pi * np.asarray(cycles_per_sample, float)
        found: ComplexArray = np.polyval(self.numerator, s) / np.polyval(self.denominator, s)
        return found

    def response_covariance(self, cycles_per_sample: ArrayLike) -> RealArray:
        """Covariance (F, 2, 2) of real and imaginary part of the response, to first order."""
        s = 2j * np.pi * np.asarray(cycles_per_sample, float)[:, None]
        below, orders = np.polyval(self.denominator, s), np.arange(len(self.denominator))[::-1]
        by_numerator = s ** orders[-len(self.numerator) :] / below
        by_denominator = -np.polyval(self.numerator, s) / below**2 * s ** orders[1:]
        gradient = np.hstack([by_numerator, by_denominator])
        parts = np.stack([gradient.real, gradient.imag], axis=1)
        found: RealArray = parts @ self.covariance @ parts.swapaxes(1, 2)
        return found

    def distance(
        self, cycles_per_sample: ArrayLike, truth: ArrayLike, *, confidence: float = 0.99
    ) -> RealArray:
        """Distance (F,) of a response (F,) from the estimate, over the region's radius there.

        The region is the ellipse that contains the true response with probability `confidence` at
        each frequency; a distance of 1 is on its boundary.
        """
        error = np.asarray(truth) - self.response(cycles_per_sample)
        parts = np.stack([error.real, error.imag], axis=-1)[..., None]
        size = parts.swapaxes(1, 2) @ np.linalg.solve(
            self.response_covariance(cycles_per_sample), parts
        )
        found: RealArray = np.sqrt(size[:, 0, 0] / stats.chi2.ppf(confidence, 2))
        return found
