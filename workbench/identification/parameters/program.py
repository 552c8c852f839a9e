"""Estimation of the physical parameters of a model from measured responses and records."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from workbench._core.heavy_types import Dataset, Figure
from workbench._core.tables import markdown_table
from workbench.answer import ProgramAnswer
from workbench.certificate import Check, OriginalAnswerChecker, quantified_checks
from workbench.errors import InputError, SolverError
from workbench.executor.effort import tries
from workbench.identification.experiments.quality import IdentificationWarning
from workbench.identification.parameters.datasets import fit_dataset
from workbench.identification.parameters.figures import fit_figures
from workbench.identification.parameters.least_squares import (
    ACTIVE_BOUND_DISTANCE,
    FittedParameter,
    LeastSquares,
)
from workbench.identification.parameters.measured import Measured
from workbench.identification.record_tests.report import together
from workbench.program import Program
from workbench.second_opinion import SEED
from workbench.solution import solve
from workbench.solvers import Options

THESE_DATA = "for these data"
"""Quantifier of a fit's checks."""
NEIGHBOURS, NEIGHBOUR_STEPS = 8, (1e-3, 1e-2, 1e-1)
"""Number of neighbours of an answer that are drawn at each distance, and the distances in standard
deviations.
"""
NEIGHBOUR_TOLERANCE = 2e-3
"""Limit on the square root of the largest decrease of the cost at a neighbour, relative to the
residuals' norm: twice what `NEWTON_STEP_TOLERANCE` allows.
"""
NEWTON_STEP_TOLERANCE = 1e-3
"""Largest change of the residuals by a Newton step from a valid answer, relative to their norm."""


@dataclass(frozen=True, eq=False)
class ParameterFit(LeastSquares, Program):
    """Weighted nonlinear least squares: the parameters for which the models fit their data best.

    The answer is the values (n,), in the order of ``parameters``. The residuals are in units of
    their standard deviation. The problem may have local minima, so no method claims to find the
    best one; raise ``starts`` if that is a concern. Arguments and errors are those of
    `LeastSquares`.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.identification import FittedParameter, MeasuredResponse, ParameterFit
    >>> frequency = np.geomspace(0.1, 10, 20)
    >>> exact = 3.0 / (2j * np.pi * frequency + 2.0)
    >>> measured = MeasuredResponse(
    ...     lambda p, s: p["k"] / (s + p["a"]), frequency, exact, variance=np.full(20, 1e-6)
    ... )
    >>> start = {"k": FittedParameter(1.0), "a": FittedParameter(1.0, lower=0.1)}
    >>> solution = wb.solve(ParameterFit([measured], start), method="scipy")
    >>> solution.certificate.valid, solution.answer.round(4).tolist()
    (True, [3.0, 2.0])
    """

    default_method: ClassVar[str] = "ipopt"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.identification.parameters.evolution",
        "workbench.identification.parameters.methods",
    )
    headline: ClassVar[str] = "chi_square"

    @property
    def problem_size(self) -> float:
        """Number of real data."""
        return float(self.count)

    def objective(self, answer: Any) -> float:
        """The sum of squared residuals, each in units of its standard deviation."""
        return float(np.sum(self.residuals(self._values(answer)) ** 2))

    def objective_rounding(self, answer: Any) -> float:
        """Square of the residual norm that a fit of exact data may leave."""
        return float((1e-9 * self.size) ** 2)

    def checks(self, answer: Any, tolerance: float) -> Sequence[Check]:
        values = self._values(answer)
        finite = np.all(np.isfinite(values))
        outside = np.maximum(self.lower - values, values - self.upper) / self.scale
        bounds = Check(
            "bounds",
            "distance beyond a bound, relative to the parameter's scale",
            float(np.max(outside)) if finite else float("nan"),
            1e-8,
            where=f"of {self.names[int(np.argmax(outside))]}",
        )
        if not finite:
            return [bounds]
        residuals, seen = self.residuals(values), self.identifiability(values)
        identifiable = Check(
            "identifiable",
            "largest over smallest singular value of the scaled Jacobian",
            seen.condition,
            1e9,
            where="; ".join(seen.blind),
        )
        stationary = Check(
            "stationary",
            "Newton's step to the optimum, bounds kept, by how it changes the residuals, over "
            "their norm (1e-9 of the data's, or with variance given 1, if that is more)",
            self._newton_step(values, residuals) / self._ground(residuals),
            NEWTON_STEP_TOLERANCE,
        )
        found = [stationary, identifiable, self._definite(values)]
        return [bounds, *quantified_checks(THESE_DATA, found)]

    def facts(self, answer: Any) -> Sequence[str]:
        reports = {one.name: getattr(one, "report", None) for one in self.data}
        return together({name: found for name, found in reports.items() if found is not None})

    def second_opinion(self, answer: Any) -> Sequence[Check]:
        values = self._values(answer)
        covariance = self.covariance(values)
        free = ~self.active(values)
        rng = np.random.default_rng(SEED)
        spread = np.sqrt(np.maximum(np.diag(covariance), 0.0)) * free
        cost = float(np.sum(self.residuals(values) ** 2))
        ground = self._ground(self.residuals(values))
        best = np.inf
        for step in NEIGHBOUR_STEPS:
            for _ in range(tries(NEIGHBOURS)):
                near = values + step * spread * rng.standard_normal(values.size)
                near = np.clip(near, self.lower, self.upper)
                best = min(best, float(np.sum(self.residuals(near) ** 2)))
        fall = max(cost - best, 0.0) ** 0.5 / ground
        statement = "root of the largest fall of the cost at neighbours drawn, over the residuals"
        over = (
            f"for {tries(NEIGHBOURS)} neighbours at each of {len(NEIGHBOUR_STEPS)} distances, "
            f"{THESE_DATA}"
        )
        return [Check("neighbours", statement, fall, NEIGHBOUR_TOLERANCE, over=over)]

    def _definite(self, values: np.ndarray) -> Check:
        """Check that the covariance of the free parameters is positive definite."""
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

    def _ground(self, residuals: np.ndarray) -> float:
        """Size below which a change of the residuals means nothing: noise, or rounding."""
        noise = float(np.linalg.norm(residuals))
        return max(noise, 1e-9 * self.size, 1.0 if self.weighted else 0.0)

    def _newton_step(self, values: np.ndarray, residuals: np.ndarray) -> float:
        """sqrt(g' H^-1 g) over the parameters that can move, with gradient g, Gauss-Newton H."""
        jacobian = self.jacobian(values) * self.scale
        gradient = jacobian.T @ residuals
        near = ACTIVE_BOUND_DISTANCE * self.scale
        held = ((values - self.lower <= near) & (gradient > 0)) | (
            (self.upper - values <= near) & (gradient < 0)
        )
        if held.all():
            return 0.0
        u, s, _ = np.linalg.svd(jacobian[:, ~held], full_matrices=False)
        seen = s > 1e-9 * s[0]  # undetermined combinations have no optimum
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
        rows = [
            (name, f"{value:.6g}", f"{half:.2g}")
            for name, value, half in zip(self.names, values, self.intervals(values), strict=True)
        ]
        table = markdown_table(["parameter", "value", "99 % interval, ±"], rows)
        return {"parameters": "\n".join([table, *(f"- {note}" for note in self.notes(values))])}

    def figures(self, answer: Any) -> dict[str, Figure]:
        named = dict(zip(self.names, map(float, self._values(answer)), strict=True))
        return fit_figures(self.data, named)

    def to_dataset(self, answer: Any) -> Dataset:
        return fit_dataset(self, self._values(answer))

    def from_dataset(self, data: Dataset) -> np.ndarray:
        return data["value"].values

    def _values(self, answer: Any) -> np.ndarray:
        """The answer as an array (n,); raises `InputError` for another shape."""
        values = np.asarray(answer, dtype=float)
        if values.shape != (len(self.names),):
            raise InputError(f"{len(self.names)} values are needed, not shape {values.shape}")
        return values


@dataclass(frozen=True, eq=False, repr=False)
class ParameterEstimate(ProgramAnswer):
    """Fitted parameters: values by name, covariance, half-widths of intervals, and warnings.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import FittedParameter, MeasuredResponse, fit_parameters
    >>> frequency = np.geomspace(0.1, 10, 20)
    >>> exact = 3.0 / (2j * np.pi * frequency + 2.0)
    >>> measured = MeasuredResponse(
    ...     lambda p, s: p["k"] / (s + p["a"]), frequency, exact, variance=np.full(20, 1e-6)
    ... )
    >>> start = {"k": FittedParameter(1.0), "a": FittedParameter(1.0, lower=0.1)}
    >>> found = fit_parameters(measured, start, confidence=0.95)
    >>> bool(found.half_widths["k"] < 1e-2), found.covariance.shape
    (True, (2, 2))
    """

    values: Mapping[str, float]
    covariance: np.ndarray
    half_widths: Mapping[str, float]
    chi_square: float
    notes: tuple[str, ...]

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    def summary(self) -> str:
        values = [
            f"{name} = {value:.6g} +- {self.half_widths[name]:.2g}"
            for name, value in self.values.items()
        ]
        lines = [f"ParameterEstimate: chi-square {self.chi_square:.5g}", *values, *self.notes]
        return "\n  ".join(lines)


def fit_parameters(
    data: Measured | Sequence[Measured],
    parameters: Mapping[str, FittedParameter],
    *,
    method: str = "ipopt",
    confidence: float = 0.99,
    options: Options | None = None,
) -> ParameterEstimate:
    """Fit parameters to measured data, with the half-widths of their confidence intervals.

    Parameters
    ----------
    data, parameters
        The same as for `ParameterFit`; a single response or record needs no list.
    method
        ``"ipopt"``, ``"scipy"`` or, between finite bounds, ``"evolution"``.
    confidence
        Probability with which each interval contains the true value.
    options
        Accuracy and time limit for the method.

    Raises
    ------
    SolverError
        The method gave no valid answer. The message says which check fails, for instance that the
        data do not determine a combination of parameters.

    Warns
    -----
    IdentificationWarning
        Active bounds, parameters that the data hardly determine, or residuals larger than the
        variance allows.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import FittedParameter, MeasuredResponse, fit_parameters
    >>> frequency = np.geomspace(0.1, 10, 20)
    >>> exact = 3.0 / (2j * np.pi * frequency + 2.0)
    >>> measured = MeasuredResponse(
    ...     lambda p, s: p["k"] / (s + p["a"]), frequency, exact, variance=np.full(20, 1e-6)
    ... )
    >>> start = {"k": FittedParameter(1.0), "a": FittedParameter(1.0, lower=0.1)}
    >>> found = fit_parameters(measured, start)
    >>> {name: round(value, 4) for name, value in found.values.items()}
    {'k': 3.0, 'a': 2.0}
    """
    program = ParameterFit(data if isinstance(data, Sequence) else [data], parameters)
    solution = solve(program, method=method, options=options)
    if solution.certificate is None or not solution.certificate.valid:
        failures = () if solution.certificate is None else solution.certificate.failures
        raise SolverError("; ".join([f"{method}: {solution.message}", *failures]))
    values = program._values(solution.answer)
    notes = tuple(program.notes(values))
    for note in notes:
        warnings.warn(note, IdentificationWarning, stacklevel=2)
    halves = program.intervals(values, confidence=confidence)
    return ParameterEstimate(
        values=dict(zip(program.names, map(float, values), strict=True)),
        covariance=program.covariance(values),
        half_widths=dict(zip(program.names, map(float, halves), strict=True)),
        chi_square=program.chi_square(values)[0],
        notes=notes,
    ).with_checker(
        OriginalAnswerChecker(program, solution.answer), certificate=solution.certificate
    )
