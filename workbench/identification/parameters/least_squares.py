"""Statistics of weighted nonlinear least squares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import stats

from workbench.errors import InputError
from workbench.identification.parameters.identifiability import Identifiability, identifiability
from workbench.identification.parameters.measured import Measured

ACTIVE_BOUND_DISTANCE = 1e-6
"""A bound is active if the parameter is this near to it, relative to the parameter's scale."""


@dataclass(frozen=True)
class FittedParameter:
    """A parameter to estimate: the start of its search, and its lower and upper bound.

    Examples
    --------
    >>> from workbench.identification import FittedParameter
    >>> FittedParameter(start=1.0, lower=0.1).upper
    inf
    """

    start: float
    _: KW_ONLY
    lower: float = -np.inf
    upper: float = np.inf

    def __post_init__(self) -> None:
        if not (np.isfinite(self.start) and self.lower <= self.start <= self.upper):
            raise InputError(
                f"a start between its bounds is needed, not {self.start:g} in "
                f"[{self.lower:g}, {self.upper:g}]"
            )
        if self.lower == self.upper:
            raise InputError(f"bounds that are both {self.lower:g} leave nothing to estimate")

    @property
    def scale(self) -> float:
        """Typical size of the parameter, the unit of its changes."""
        span = self.upper - self.lower
        return abs(self.start) or (span if np.isfinite(span) else 1.0)


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Data with their models, and parameters with starts and bounds.

    Parameters
    ----------
    data
        One or several `MeasuredResponse` or `MeasuredRecord`, all with variance or all without.
    parameters
        Each a `FittedParameter`, by name.
    starts
        Number of starting points. The first is the given one; the others are drawn between the
        bounds, which must be finite, on a logarithmic scale where both are positive.

    Raises
    ------
    InputError
        No data, no parameters, more parameters than data, or infinite bounds with several starts.
    """

    data: Sequence[Measured]
    parameters: Mapping[str, FittedParameter]
    _: KW_ONLY
    starts: int = 1

    def __post_init__(self) -> None:
        if not self.data or not self.parameters:
            raise InputError("a fit needs data and parameters")
        if len({one.weighted for one in self.data}) > 1:
            raise InputError("give the variance of every response and record, or of none")
        if len({one.name for one in self.data}) < len(self.data):
            raise InputError("responses and records need different names")
        if self.spare < 1:
            raise InputError(
                f"{len(self.parameters)} parameters are too many for {self.count} real data: "
                "use a model of lower order or measure more"
            )
        if self.starts > 1 and not np.all(np.isfinite([self.lower, self.upper])):
            raise InputError("several starts are drawn between the bounds: make all of them finite")

    # --- parameters -----------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(self.parameters)

    def _each(self, attribute: str) -> np.ndarray:
        """An attribute of every parameter, shape (n,)."""
        return np.array([getattr(one, attribute) for one in self.parameters.values()], float)

    @property
    def lower(self) -> np.ndarray:
        """Lower bounds, shape (n,)."""
        return self._each("lower")

    @property
    def upper(self) -> np.ndarray:
        """Upper bounds, shape (n,)."""
        return self._each("upper")

    @cached_property
    def scale(self) -> np.ndarray:
        """Typical sizes of the parameters, the units of their changes, shape (n,)."""
        return self._each("scale")

    def starting_points(self, rng: np.random.Generator) -> np.ndarray:
        """Starting points of the search, shape (starts, n)."""
        points = [self._each("start")]
        if self.starts > 1:
            low, high = self.lower, self.upper
            share = rng.uniform(size=(self.starts - 1, len(low)))
            positive = low > 0
            safe_low, safe_high = np.where(positive, low, 1.0), np.where(positive, high, 1.0)
            geometric = safe_low * (safe_high / safe_low) ** share
            points.extend(np.where(positive, geometric, low + (high - low) * share))
        return np.array(points)

    def active(self, values: np.ndarray) -> np.ndarray:
        """Mask (n,) of the parameters that lie on a bound."""
        near = ACTIVE_BOUND_DISTANCE * self.scale
        return (values - self.lower <= near) | (self.upper - values <= near)

    # --- residuals ------------------------------------------------------------------------------

    @property
    def count(self) -> int:
        """Number of real data."""
        return sum(one.count for one in self.data)

    @property
    def spare(self) -> int:
        """Degrees of freedom of the residuals: number of data less number of parameters."""
        return self.count - len(self.parameters)

    @property
    def size(self) -> float:
        """Norm of the data, each in units of its standard deviation."""
        return float(np.linalg.norm([one.size for one in self.data]))

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """Model minus data (count,), in units of the data's standard deviation, by NumPy."""
        named = dict(zip(self.names, map(float, values), strict=True))
        return np.concatenate([one.residuals(named) for one in self.data])

    def jacobian(self, values: np.ndarray) -> np.ndarray:
        """Derivatives (count, n) of the residuals, by central differences."""
        sizes = np.maximum(np.abs(values), 1e-3 * self.scale)
        columns = []
        for index, step in enumerate(np.finfo(float).eps ** (1 / 3) * sizes):
            ahead, behind = values.copy(), values.copy()
            ahead[index] += step
            behind[index] -= step
            change = self.residuals(ahead) - self.residuals(behind)
            columns.append(change / (ahead[index] - behind[index]))
        return np.stack(columns, axis=1)

    # --- statistics -----------------------------------------------------------------------------

    @property
    def weighted(self) -> bool:
        """Whether the variance of the data is given."""
        return self.data[0].weighted

    def _per_residual(self, of_degrees: Any) -> np.ndarray:
        """Value for each residual (count,) of a function of its variance's degrees of freedom."""
        return np.concatenate([np.full(one.count, of_degrees(one.degrees)) for one in self.data])

    def covariance(self, values: np.ndarray) -> np.ndarray:
        """Covariance (n, n) of the estimate; NaN for parameters on a bound.

        It is the covariance of the residuals, transformed by the pseudo-inverse of the Jacobian.
        Where a weight is an estimate with nu degrees of freedom, the variance grows by
        nu / (nu - 4), which is (M - 1) / (M - 3) for M periods (Schoukens et al., Automatica 33(6),
        1997). If no variance is given, it is estimated from the residuals.
        """
        free = np.flatnonzero(~self.active(values))
        covariance = np.full((len(values), len(values)), np.nan)
        if not len(free):
            return covariance
        sizes = np.maximum(np.abs(values), 1e-3 * self.scale)[free]
        u, s, vt = np.linalg.svd(self.jacobian(values)[:, free] * sizes, full_matrices=False)
        with np.errstate(divide="ignore", invalid="ignore"):
            estimator = (vt.T / s) @ u.T
            spread = self._per_residual(lambda nu: 1.0 if np.isinf(nu) else nu / (nu - 4))
            if not self.weighted:
                spread = spread * np.sum(self.residuals(values) ** 2) / self.spare
            scaled = (estimator * spread) @ estimator.T
            covariance[np.ix_(free, free)] = scaled * np.outer(sizes, sizes)
        return covariance

    def intervals(self, values: np.ndarray, *, confidence: float = 0.99) -> np.ndarray:
        """Half-widths (n,) of the parameters' confidence intervals; NaN on a bound."""
        level = (1 + confidence) / 2
        quantile = stats.norm.ppf(level) if self.weighted else stats.t.ppf(level, self.spare)
        return quantile * np.sqrt(np.diag(self.covariance(values)))

    def chi_square(self, values: np.ndarray) -> tuple[float, float]:
        """Ratio of the sum of squares to its expectation under noise alone, and its p-value.

        A low p-value says that the structure of the model is wrong or the variance too small; the
        intervals are then meaningless. Without a given variance the results are 1 and NaN.
        """
        if not self.weighted:
            return 1.0, float("nan")
        shrink = self._per_residual(lambda nu: 1.0 if np.isinf(nu) else (nu - 2) / nu)
        ratio = float(np.sum(self.residuals(values) ** 2 * shrink)) / self.spare
        # Squares with estimated weights scatter more: use fewer degrees of freedom, same mean.
        wide = float(np.mean(self._per_residual(lambda nu: 1.0 if np.isinf(nu) else nu / (nu - 4))))
        return ratio, float(stats.chi2.sf(ratio * self.spare / wide, self.spare / wide))

    def identifiability(self, values: np.ndarray) -> Identifiability:
        """Identifiability of the parameters that are not on a bound."""
        free = ~self.active(values)
        spread = 1.0
        if not self.weighted:
            spread = float(np.sqrt(np.sum(self.residuals(values) ** 2) / self.spare))
        sizes = np.maximum(np.abs(values), 1e-3 * self.scale)
        names = [name for name, is_free in zip(self.names, free, strict=True) if is_free]
        return identifiability((self.jacobian(values) * sizes)[:, free], names, spread)

    def notes(self, values: np.ndarray) -> list[str]:
        """Warnings about the intervals: active bounds, hidden combinations, large residuals."""
        notes = []
        for i in np.flatnonzero(self.active(values)):
            side, bound = ("lower", self.lower[i])
            if self.upper[i] - values[i] < values[i] - self.lower[i]:
                side, bound = ("upper", self.upper[i])
            notes.append(
                f"{self.names[i]} lies on its {side} bound {bound:g} and has no interval: "
                "check the bound, or fix the parameter"
            )
        notes += self.identifiability(values).unseen
        ratio, p = self.chi_square(values)
        if p < 1e-3:
            notes.append(
                f"the residuals are {ratio:.3g} times what the data's variance allows (p = {p:.1g})"
                ": the model lacks something, for instance order, and the intervals do not hold"
            )
        return notes
