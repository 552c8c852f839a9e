"""The statistics of weighted nonlinear least squares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import stats

from workbench.errors import InputError
from workbench.identification.parameters.identifiability import Identifiability, identifiability
from workbench.identification.parameters.measured import Measured

AT_BOUND = 1e-6
"""Distance from a bound, relative to the parameter's scale, at which it counts as active."""


@dataclass(frozen=True)
class FittedParameter:
    """Where the search of a parameter starts and between which bounds it stays."""

    start: float
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
        """A size to count changes in."""
        span = self.upper - self.lower
        return abs(self.start) or (span if np.isfinite(span) else 1.0)


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Data with their models, and parameters between bounds.

    Parameters
    ----------
    data
        One or several `MeasuredResponse` or `MeasuredRecord`, all with variance or all without.
    parameters
        `FittedParameter` by name.
    starts
        Starting points: the given one, and others drawn between the bounds, which must then be
        finite (logarithmically where both are positive).

    Raises
    ------
    InputError
        No data, no parameters, more parameters than data, or bounds missing for many starts.
    """

    data: Sequence[Measured]
    parameters: Mapping[str, FittedParameter]
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
        return tuple(self.parameters)

    def _each(self, attribute: str) -> np.ndarray:
        return np.array([getattr(one, attribute) for one in self.parameters.values()], float)

    @property
    def lower(self) -> np.ndarray:
        return self._each("lower")

    @property
    def upper(self) -> np.ndarray:
        return self._each("upper")

    @cached_property
    def scale(self) -> np.ndarray:
        """Sizes to count changes of the parameters in, shape (n,)."""
        return self._each("scale")

    def starting_points(self, rng: np.random.Generator) -> np.ndarray:
        """Shape (starts, n)."""
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
        """Which parameters lie on a bound, boolean, shape (n,)."""
        near = AT_BOUND * self.scale
        return (values - self.lower <= near) | (self.upper - values <= near)

    # --- residuals ------------------------------------------------------------------------------

    @property
    def count(self) -> int:
        """Real numbers measured."""
        return sum(one.count for one in self.data)

    @property
    def spare(self) -> int:
        """Degrees of freedom that the fit leaves."""
        return self.count - len(self.parameters)

    @property
    def size(self) -> float:
        """Norm of the data in units of their standard deviation."""
        return float(np.linalg.norm([one.size for one in self.data]))

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """Model less data in units of the data's standard deviation, shape (count,), by NumPy."""
        named = dict(zip(self.names, map(float, values), strict=True))
        return np.concatenate([one.residuals(named) for one in self.data])

    def jacobian(self, values: np.ndarray) -> np.ndarray:
        """Derivatives of the residuals by central differences, shape (count, n)."""
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
        """The data's variance is given."""
        return self.data[0].weighted

    def _per_residual(self, of_degrees: Any) -> np.ndarray:
        """A function of each datum's degrees of freedom, for every residual."""
        return np.concatenate([np.full(one.count, of_degrees(one.degrees)) for one in self.data])

    def covariance(self, values: np.ndarray) -> np.ndarray:
        """Covariance of the estimate, shape (n, n); NaN for parameters on a bound.

        Residuals pass through the pseudo-inverse of the Jacobian. Where a weight is itself an
        estimate of nu degrees of freedom the variance grows by nu / (nu - 4): for M periods
        (M - 1) / (M - 3) (Schoukens et al., Automatica 33(6), 1997). Where no variance is given
        it is that of the residuals.
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

    def intervals(self, values: np.ndarray, confidence: float = 0.99) -> np.ndarray:
        """Half-widths of the intervals of the parameters, shape (n,); NaN on a bound."""
        level = (1 + confidence) / 2
        quantile = stats.norm.ppf(level) if self.weighted else stats.t.ppf(level, self.spare)
        return quantile * np.sqrt(np.diag(self.covariance(values)))

    def chi_square(self, values: np.ndarray) -> tuple[float, float]:
        """Sum of squares over what noise alone would leave, and the p-value of a larger one.

        A low p-value says that the model's structure is wrong, or the variance too small; the
        intervals then say nothing. Without a given variance nothing is said: 1 and NaN.
        """
        if not self.weighted:
            return 1.0, float("nan")
        shrink = self._per_residual(lambda nu: 1.0 if np.isinf(nu) else (nu - 2) / nu)
        ratio = float(np.sum(self.residuals(values) ** 2 * shrink)) / self.spare
        # The squares of estimated weights scatter more: fewer degrees of freedom, same mean.
        wide = float(np.mean(self._per_residual(lambda nu: 1.0 if np.isinf(nu) else nu / (nu - 4))))
        return ratio, float(stats.chi2.sf(ratio * self.spare / wide, self.spare / wide))

    def identifiability(self, values: np.ndarray) -> Identifiability:
        """Which combinations of the parameters off their bounds the data see."""
        free = ~self.active(values)
        spread = 1.0
        if not self.weighted:
            spread = float(np.sqrt(np.sum(self.residuals(values) ** 2) / self.spare))
        sizes = np.maximum(np.abs(values), 1e-3 * self.scale)
        names = [name for name, is_free in zip(self.names, free, strict=True) if is_free]
        return identifiability((self.jacobian(values) * sizes)[:, free], names, spread)

    def notes(self, values: np.ndarray) -> list[str]:
        """What a user must know before believing the intervals."""
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
