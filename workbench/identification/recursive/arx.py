"""Recursive least squares with forgetting: ARX models that track a plant sample by sample.

The triangular factor of the weighted regression is updated, never a covariance. So the estimate is
exactly that of weighted least squares on all samples so far, without accumulated rounding. Source:
L. Ljung, System Identification, 2nd ed., 1999, sections 11.2 and 11.7.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.regression import least_squares
from workbench.identification.polynomials.regressions import arx_from_lags
from workbench.input_checks import need_count, need_whole


def need_forgetting(forgetting: float) -> float:
    """The forgetting factor; raises `InputError` unless it lies above 0 and is at most 1."""
    if isinstance(forgetting, bool) or not isinstance(forgetting, (int, float, np.floating)):
        raise InputError(f"forgetting is {forgetting!r}; a number above 0 and at most 1 is needed")
    if not 0 < forgetting <= 1:
        raise InputError(f"forgetting is {forgetting!r}; it must be above 0 and at most 1")
    return float(forgetting)


def as_sample(values: ArrayLike, count: int, name: str) -> RealArray:
    """One sample (count,) of finite numbers; raises `InputError` for anything else."""
    found = np.atleast_1d(np.asarray(values, dtype=float))
    if found.shape != (count,) or not np.isfinite(found).all():
        raise InputError(
            f"{name} is {values!r}; a sample of {count} finite numbers is needed, one for each "
            "channel"
        )
    return found


class RecursiveARX:
    """ARX model of a plant, updated with every sample of its inputs and outputs.

        y(t) + A_1 y(t-1) + ... + A_n y(t-n) = level + B_0 u(t) + ... + B_n u(t-n) + e(t)

    Parameters
    ----------
    order
        Degree n.
    inputs, outputs
        Numbers of channels nu and ny.
    forgetting
        Factor by which the weight of a sample shrinks with each later one, above 0 and at most 1;
        about 1 / (1 - forgetting) samples have weight.
    direct
        Whether inputs may act within the sample; otherwise B_0 = 0.
    dt
        Sampling time [s] of the model.

    Raises
    ------
    InputError
        A number of channels or the order is not valid, or the factor is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import RecursiveARX
    >>> estimate, y = RecursiveARX(1, forgetting=0.98), 0.0
    >>> for u in np.random.default_rng(0).standard_normal(200):
    ...     y = 0.5 * y + u
    ...     error = estimate.update(u, y)
    >>> float(estimate.model().A[0, 0].round(4))
    0.5
    """

    def __init__(
        self,
        order: int,
        *,
        inputs: int = 1,
        outputs: int = 1,
        forgetting: float = 1.0,
        direct: bool = True,
        dt: float = 1.0,
    ) -> None:
        for name, value in (("order", order), ("inputs", inputs), ("outputs", outputs)):
            need_whole(value, name)
            need_count(name, value)
        self.order, self.forgetting = int(order), need_forgetting(forgetting)
        self._nu, self._ny = int(inputs), int(outputs)
        self._direct, self._sample_time = direct, dt
        m = self._nu + self._ny
        self._past = np.zeros((self.order, m))
        count = 1 + self.order * m + (self._nu if direct else 0)
        self._factor = np.zeros((count, count + self._ny))
        self._seen = 0

    @property
    def coefficients(self) -> RealArray:
        """Estimate (ny, p): the level, the lags (u, y) from the latest, and u of the same sample.

        Coefficients that the samples do not determine have minimum norm, in units of the data.
        """
        count = len(self._factor)
        return least_squares(self._factor[:, :count], self._factor[:, count:])

    def update(self, u: ArrayLike, y: ArrayLike) -> RealArray:
        """Process a sample u (nu,), y (ny,) and return its prediction error (ny,).

        The error is NaN for the first `order` samples, since there is no past to predict from.
        """
        now, measured = as_sample(u, self._nu, "u"), as_sample(y, self._ny, "y")
        error = np.full(self._ny, np.nan)
        if self._seen >= self.order:
            row = np.concatenate([[1.0], self._past.ravel(), now if self._direct else []])
            error = measured - self.coefficients @ row
            rows = np.vstack(
                [np.sqrt(self.forgetting) * self._factor, np.concatenate([row, measured])]
            )
            self._factor = np.asarray(np.linalg.qr(rows, mode="r"))[: len(self._factor)]
        self._past = np.vstack([np.concatenate([now, measured]), self._past])[: self.order]
        self._seen += 1
        return error

    def model(self) -> InnovationsModel:
        """The present model."""
        found, m = self.coefficients, self._nu + self._ny
        lags = found[:, 1 : 1 + self.order * m].reshape(self._ny, self.order, m)
        D = found[:, 1 + self.order * m :] if self._direct else np.zeros((self._ny, self._nu))
        return replace(arx_from_lags(lags, D, found[:, 0]), dt=self._sample_time)
