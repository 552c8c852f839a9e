"""The recursive prediction-error method for ARMAX models.

With each sample the estimate makes a Gauss-Newton step on the prediction errors so far. The
gradient of a prediction consists of its regressors, filtered by 1/C. C is kept stable: a step that
would make it unstable is shortened. Source: L. Ljung, System Identification, 2nd ed., 1999,
sections 11.4 (the method), 11.5 (its projection) and 11.6 (forgetting that begins fast).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import BoolArray, RealArray
from workbench.identification.innovations.gains import operating_point
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.recursive.arx import as_sample, need_forgetting
from workbench.input_checks import need_count, need_whole

PRIOR_VARIANCE = 10.0
"""Variance of the coefficients before the first sample, in units of the errors' variance.

The first steps must be small, since the criterion is not quadratic.
"""
FIRST_FORGETTING = 0.95
"""Forgetting factor at the first sample, where errors come from a poor model."""
FORGETTING_RATE = 0.99
"""Factor by which the distance to the final forgetting factor shrinks with each sample."""
LARGEST_NOISE_POLE = 0.995
"""Largest modulus of a root of C, which is a pole of the predictor."""
FIRST_SAMPLES = 30
"""Number of first samples that determine the units of the channels; during them the estimation
restarts after each sample.
"""
HALVINGS = 10
"""Number of times that a step is halved to keep C stable, before it is dropped."""


class RecursiveARMAX:
    """ARMAX model with one output, updated with every sample by recursive prediction errors.

        A(q) y(t) = level + B(q) u(t) + C(q) e(t),   A, B and C of the same degree

    Parameters
    ----------
    order
        Degree n.
    inputs
        Number of inputs nu.
    forgetting
        Factor by which the weight of a sample shrinks with each later one, above 0 and at most 1.
    direct
        Whether inputs may act within the sample.
    dt
        Sampling time [s] of the model.

    Raises
    ------
    InputError
        The number of inputs or the order is not valid, or the factor is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import RecursiveARMAX
    >>> rng, estimate, y, before = np.random.default_rng(0), RecursiveARMAX(1), 0.0, 0.0
    >>> for u, e in rng.standard_normal((4000, 2)):
    ...     y, before = 0.5 * y + u + e + 0.8 * before, e
    ...     error = estimate.update(u, y)
    >>> [float(c) for c in estimate.noise_polynomial.round(1)]
    [1.0, 0.8]
    """

    def __init__(
        self,
        order: int,
        *,
        inputs: int = 1,
        forgetting: float = 1.0,
        direct: bool = True,
        dt: float = 1.0,
    ) -> None:
        for name, value in (("order", order), ("inputs", inputs)):
            need_whole(value, name)
            need_count(name, value)
        self.order, self.forgetting = int(order), need_forgetting(forgetting)
        self._nu, self._direct, self._sample_time = int(inputs), direct, dt
        n = self.order
        self._count = 1 + n + (n + int(direct)) * self._nu + n
        self._first: list[tuple[RealArray, float]] = []
        self._units: RealArray = np.ones(self._nu + 1)
        self._unmoved: BoolArray = np.ones(self._nu + 1, dtype=bool)
        self._start()

    def _start(self) -> None:
        """Forget everything except the units of the samples."""
        n = self.order
        self._scaled = np.zeros(self._count)
        self._covariance = PRIOR_VARIANCE * np.eye(self._count)
        self._factor = min(FIRST_FORGETTING, self.forgetting)
        self._u, self._y, self._e = np.zeros((n, self._nu)), np.zeros(n), np.zeros(n)
        self._gradients = np.zeros((n, self._count))
        self._seen = 0

    @property
    def coefficients(self) -> RealArray:
        """The level, A, the lags of u from the latest, u of the same sample if it acts, and C."""
        n, unit, units = self.order, self._units[-1], self._units[:-1]
        inputs = np.tile(unit / units, n + int(self._direct))
        return self._scaled * np.concatenate([[unit], np.ones(n), inputs, np.ones(n)])

    @property
    def noise_polynomial(self) -> RealArray:
        """C (n + 1,), its first coefficient 1."""
        return np.concatenate([[1.0], self._scaled[self._count - self.order :]])

    def update(self, u: ArrayLike, y: float) -> float:
        """Process a sample u (nu,), y and return its prediction error.

        The error is NaN for the first `order` samples, since there is no past to predict from.
        """
        now, measured = as_sample(u, self._nu, "u"), float(as_sample(y, 1, "y")[0])
        if len(self._first) < FIRST_SAMPLES:
            self._first.append((now, measured))
            samples = np.array([[*inputs, output] for inputs, output in self._first])
            self._units = _units(samples)
            self._unmoved = np.asarray((samples == 0).all(axis=0))
            self._start()
            for earlier in self._first[:-1]:
                self._take(*earlier)
        else:  # a channel that has been zero so far may have any unit: no state depends on it
            values = np.abs([*now, measured])
            self._units = np.where(self._unmoved, np.where(values > 0, values, 1.0), self._units)
            self._unmoved = np.asarray(self._unmoved & (values == 0))
        return self._take(now, measured)

    def _take(self, u: RealArray, y: float) -> float:
        """Process a sample and return its prediction error, in units of y."""
        now, measured = u / self._units[:-1], y / self._units[-1]
        error, left = np.nan, 0.0
        if self._seen >= self.order:
            row = np.concatenate(
                [[1.0], -self._y, self._u.ravel(), now if self._direct else [], self._e]
            )
            error = measured - float(self._scaled @ row)
            gradient = row - self.noise_polynomial[1:] @ self._gradients
            self._step(gradient, error)
            left = measured - float(self._scaled @ row)
            self._gradients = np.vstack([gradient, self._gradients])[: self.order]
        self._u = np.vstack([now, self._u])[: self.order]
        self._y = np.concatenate([[measured], self._y])[: self.order]
        self._e = np.concatenate([[left], self._e])[: self.order]
        self._seen += 1
        return error * self._units[-1]

    def _step(self, gradient: RealArray, error: float) -> None:
        """A Gauss-Newton step, shortened until C is stable."""
        moved = self._covariance @ gradient
        gain = moved / (self._factor + float(gradient @ moved))
        covariance = (self._covariance - np.outer(gain, moved)) / self._factor
        self._covariance = (covariance + covariance.T) / 2
        self._factor = FORGETTING_RATE * self._factor + (1 - FORGETTING_RATE) * self.forgetting
        before, share = self._scaled, 1.0
        for _ in range(HALVINGS):
            self._scaled = before + share * gain * error
            if np.max(np.abs(np.roots(self.noise_polynomial)), initial=0.0) < LARGEST_NOISE_POLE:
                return
            share /= 2
        self._scaled = before

    def model(self) -> InnovationsModel:
        """The present model."""
        n, nu = self.order, self._nu
        level, a = self.coefficients[0], self.coefficients[1 : 1 + n]
        b = self.coefficients[1 + n : 1 + n + n * nu].reshape(n, nu)
        c = self.noise_polynomial[1:]
        D = np.zeros((1, nu))
        if self._direct:
            D = self.coefficients[1 + n + n * nu : 1 + n + n * nu + nu].reshape(1, nu)
        A = np.eye(n, k=1)
        A[:, 0] = -a
        B, C, K = b - a[:, None] * D, np.eye(1, n), (c - a)[:, None]
        forcing = np.zeros(n)
        forcing[0] = level
        offsets = operating_point(A, B, C, D, forcing, np.zeros(1))
        return InnovationsModel(A, B, C, D, K, *offsets, dt=self._sample_time)


def _units(samples: RealArray) -> RealArray:
    """Spreads of channels (N, channels); the size of a constant channel; 1 without samples."""
    spread, size = samples.std(axis=0), np.abs(samples).max(axis=0)
    rounding = np.finfo(float).eps * len(samples) * size
    return np.asarray(np.where(spread > rounding, spread, np.where(size > 0, size, 1.0)))
