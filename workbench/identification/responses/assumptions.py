"""Tests of the assumptions on the noise of repeated periods that confidence regions rely on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats


@dataclass(frozen=True)
class Assumptions:
    """p-values of the assumptions behind the region of a periodic response; NaN if untestable.

    Parameters
    ----------
    circular
        Equal variance and independence of real and imaginary part. The test is the likelihood ratio
        W of sphericity at each frequency, with P(W <= w) = w^((M - 2) / 2) (Anderson, An
        Introduction to Multivariate Statistical Analysis, section 10.7); the frequencies are
        combined by Fisher's rule.
    normal
        Normal distribution, by the kurtosis of the residuals over all frequencies, compared with
        its moments on the complex sphere.
    independent
        Independence of successive periods, by their correlation; low with transients or drifts.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import periodic_response
    >>> rng = np.random.default_rng(0)
    >>> noise = rng.standard_normal((2, 50, 8, 2)) @ [1, 1j]
    >>> found = periodic_response(np.arange(1, 51), 1 + 1e-3 * noise[0], 0.5 + 1e-3 * noise[1])
    >>> found.assumptions.holds()
    True
    """

    circular: float
    normal: float
    independent: float

    def holds(self, *, level: float = 0.01) -> bool:
        """Whether no test rejects at this level, shared among the three tests."""
        return all(not p < level / 3 for p in (self.circular, self.normal, self.independent))


def assess(residual: np.ndarray) -> Assumptions:
    """p-values from residuals of shape (sets, periods), each set about its own mean."""
    periods = residual.shape[1]
    power = np.sum(np.abs(residual) ** 2, axis=1)
    residual, power = residual[power > 0], power[power > 0]
    if not len(power) or periods < 3:
        return Assumptions(np.nan, np.nan, np.nan)
    spheric = 1 - np.abs(np.sum(residual**2, axis=1) / power) ** 2
    logs = np.log(np.maximum(spheric, np.finfo(float).tiny)) * (periods - 2) / 2
    circular = float(stats.chi2.sf(-2 * np.sum(logs), 2 * len(logs)))
    # Residuals over their length are uniform on the complex sphere of dimension m = M - 1.
    m, shared = periods - 1, 1 / (periods - 1) ** 2
    fourth = np.sum(np.abs(residual) ** 4, axis=1) / power**2
    mean = 2 * m / periods**2
    square = (m / periods) ** 4 * periods * (24 + m * (4 + 16 * shared + 4 * shared**2))
    spread = square / (m * (m + 1) * (m + 2) * (m + 3)) - mean**2
    centring = np.eye(periods) - 1 / periods
    form = centring @ (np.eye(periods, k=1) + np.eye(periods, k=-1)) @ centring / 2
    lagged = np.einsum("sp,pq,sq->s", residual.conj(), form, residual).real / power
    middle = np.trace(form) / m
    scatter = (np.trace(form) ** 2 + np.trace(form @ form)) / (m * (m + 1)) - middle**2
    return Assumptions(
        circular, _two_sided(fourth, mean, spread), _two_sided(lagged, middle, scatter)
    )


def _two_sided(values: np.ndarray, mean: float, variance: float) -> float:
    """p-value of the mean of independent values, by the central limit theorem."""
    if not variance > 1e-12:
        return float("nan")
    deviation: Any = (values.mean() - mean) / np.sqrt(variance / len(values))
    return float(2 * stats.norm.sf(abs(deviation)))
