"""Physical parameters of a model from measured responses and records."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy import stats

from workbench.errors import InputError, SolverError
from workbench.identification.identifiability import Identifiability, identifiability
from workbench.identification.measured import Measured
from workbench.identification.quality import IdentificationWarning
from workbench.program import Check, Program, solve
from workbench.solvers import Options

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

AT_BOUND = 1e-6
"""Distance from a bound, relative to the parameter's scale, at which it counts as active."""
STATIONARY = 1e-3
"""Newton's step from an answer to the optimum, relative to the residuals, that is let pass."""


@dataclass(frozen=True)
class Parameter:
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
class ParameterFit(Program):
    """Weighted nonlinear least squares: parameters by which models meet their data.

    The answer is the values, shape (n,), in the order of ``parameters``. The residuals are in
    units of their standard deviation. The problem may have local minima, so no method claims the
    best; raise ``starts`` where that is feared.

    Parameters
    ----------
    data
        One or several `MeasuredResponse` or `MeasuredRecord`, all with variance or all without.
    parameters
        `Parameter` by name.
    starts
        Starting points: the given one, and others drawn between the bounds, which must then be
        finite (logarithmically where both are positive).

    Raises
    ------
    InputError
        No data, no parameters, more parameters than data, or bounds missing for many starts.
    """

    data: Sequence[Measured]
    parameters: Mapping[str, Parameter]
    starts: int = 1

    default_method: ClassVar[str] = "ipopt"
    headline: ClassVar[str] = "chi_square"

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
        seen = self.identifiability(values)
        notes += [f"{text}: fix one of them or add data" for text in seen.unseen]
        ratio, p = self.chi_square(values)
        if p < 1e-3:
            notes.append(
                f"the residuals are {ratio:.3g} times what the data's variance allows (p = {p:.1g})"
                ": the model lacks something, for instance order, and the intervals do not hold"
            )
        return notes

    # --- the task -------------------------------------------------------------------------------

    def checks(self, answer: Any, tolerance: float) -> Sequence[Check]:
        values = self._values(answer)
        finite = np.all(np.isfinite(values))
        outside = np.maximum(self.lower - values, values - self.upper) / self.scale
        bounds = Check(
            "bounds",
            "distance beyond a bound, relative to the parameter's scale",
            float(np.max(outside)) if finite else float("nan"),
            1e-8,
            f"of {self.names[int(np.argmax(outside))]}",
        )
        if not finite:
            return [bounds]
        residuals, seen = self.residuals(values), self.identifiability(values)
        identifiable = Check(
            "identifiable",
            "largest over smallest singular value of the scaled Jacobian",
            seen.condition,
            1e9,
            "; ".join(seen.blind),
        )
        stationary = Check(
            "stationary",
            "Newton's step to the optimum, bounds kept, in standard deviations, "
            "over the norm of the residuals (or 1)",
            self._newton_step(values, residuals) / max(1.0, float(np.linalg.norm(residuals))),
            STATIONARY,
        )
        return [bounds, stationary, identifiable, self._definite(values)]

    def _definite(self, values: np.ndarray) -> Check:
        """The covariance of the free parameters is one, by its correlation matrix."""
        covariance = self.covariance(values)
        free = ~self.active(values)
        inner = covariance[np.ix_(free, free)]
        smallest = 1.0
        if free.any():
            sigma = np.sqrt(np.diag(inner))
            correlation = inner / np.outer(sigma, sigma)
            usable = np.all(np.isfinite(correlation))
            smallest = float(np.linalg.eigvalsh(correlation)[0]) if usable else float("nan")
        return Check(
            "covariance", "minus the smallest eigenvalue of the correlations", -smallest, 0.0
        )

    def _newton_step(self, values: np.ndarray, residuals: np.ndarray) -> float:
        """sqrt(g' H^-1 g) over the parameters that may move, H of Gauss and Newton."""
        jacobian = self.jacobian(values) * self.scale
        gradient = jacobian.T @ residuals
        near = AT_BOUND * self.scale
        held = ((values - self.lower <= near) & (gradient > 0)) | (
            (self.upper - values <= near) & (gradient < 0)
        )
        if held.all():
            return 0.0
        u, s, _ = np.linalg.svd(jacobian[:, ~held], full_matrices=False)
        seen = s > 1e-9 * s[0]  # along what the data cannot see there is no optimum to miss
        return float(np.linalg.norm(u.T[seen] @ residuals))

    def metrics(self, answer: Any) -> dict[str, float]:
        values = self._values(answer)
        ratio, p = self.chi_square(values)
        numbers = {"chi_square": ratio, "chi_square_p": p}
        numbers["active_bounds"] = int(np.sum(self.active(values)))
        numbers["condition"] = self.identifiability(values).condition
        for name, value, half in zip(self.names, values, self.intervals(values), strict=True):
            numbers |= {name: float(value), f"{name}_half_width_99": float(half)}
        return numbers

    def tables(self, answer: Any) -> dict[str, str]:
        values = self._values(answer)
        rows = ["| parameter | value | 99 % interval, +- |", "| --- | --- | --- |"]
        for name, value, half in zip(self.names, values, self.intervals(values), strict=True):
            rows.append(f"| {name} | {value:.6g} | {half:.2g} |")
        return {"parameters": "\n".join([*rows, "", *(f"- {n}" for n in self.notes(values))])}

    def figures(self, answer: Any) -> dict[str, Figure]:
        from workbench.identification.figures import fit_figures

        named = dict(zip(self.names, map(float, self._values(answer)), strict=True))
        return fit_figures(self.data, named)

    def to_dataset(self, answer: Any) -> xr.Dataset:
        from workbench.identification.datasets import fit_dataset

        return fit_dataset(self, self._values(answer))

    def from_dataset(self, data: xr.Dataset) -> np.ndarray:
        return data["value"].values

    def _values(self, answer: Any) -> np.ndarray:
        values = np.asarray(answer, dtype=float)
        if values.shape != (len(self.names),):
            raise InputError(f"{len(self.names)} values are needed, not shape {values.shape}")
        return values


@dataclass(frozen=True, eq=False)
class ParameterEstimate:
    """Fitted parameters: values by name, their covariance, and what to know before using them."""

    values: Mapping[str, float]
    covariance: np.ndarray
    half_widths: Mapping[str, float]
    chi_square: float
    notes: tuple[str, ...]

    def __getitem__(self, name: str) -> float:
        return self.values[name]


def fit_parameters(
    data: Measured | Sequence[Measured],
    parameters: Mapping[str, Parameter],
    *,
    method: str = "ipopt",
    confidence: float = 0.99,
    options: Options | None = None,
) -> ParameterEstimate:
    """Parameters by which models meet their data, with the half-widths of their intervals.

    Parameters
    ----------
    data, parameters
        As `ParameterFit`; a single datum may stand alone.
    method
        ``"ipopt"`` or ``"scipy"``.
    confidence
        Of the intervals.

    Raises
    ------
    SolverError
        The method gave no valid answer; the message says which check fails, for instance that
        the data cannot tell parameters apart.

    Warns
    -----
    IdentificationWarning
        Active bounds, parameters hardly seen, residuals larger than the variance allows.
    """
    program = ParameterFit(data if isinstance(data, Sequence) else [data], parameters)
    solution = solve(program, method, options)
    if solution.certificate is None or not solution.certificate.valid:
        failures = () if solution.certificate is None else solution.certificate.failures
        raise SolverError("; ".join([f"{method}: {solution.message}", *failures]))
    values = program._values(solution.answer)
    notes = tuple(program.notes(values))
    for note in notes:
        warnings.warn(note, IdentificationWarning, stacklevel=2)
    halves = program.intervals(values, confidence)
    return ParameterEstimate(
        values=dict(zip(program.names, map(float, values), strict=True)),
        covariance=program.covariance(values),
        half_widths=dict(zip(program.names, map(float, halves), strict=True)),
        chi_square=program.chi_square(values)[0],
        notes=notes,
    )
