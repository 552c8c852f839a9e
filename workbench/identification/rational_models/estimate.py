"""From a measured response to a rational model with bands, in one call."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import Figure, StateSpace
from workbench.answer import ProgramAnswer
from workbench.certificate import OriginalAnswerChecker
from workbench.errors import SolverError
from workbench.identification.experiments.quality import IdentificationWarning
from workbench.identification.rational_models.figures import rational_model_figure
from workbench.identification.rational_models.model import CommonPoleModel
from workbench.identification.rational_models.program import RationalModelFit
from workbench.identification.rational_models.residual_tests import ResidualTests
from workbench.identification.rational_models.uncertainty import ModelUncertainty
from workbench.identification.responses.periodic import ResponseEstimate
from workbench.solution import solve
from workbench.solvers import Options

DEGREES_PER_ENTRY = 6.0
"""Degrees of freedom per entry from which covariance matrices are used as weights."""


@dataclass(frozen=True, eq=False, repr=False)
class RationalModelEstimate(ProgramAnswer):
    """A rational model of a response, its uncertainty, and tests of its residuals.

    ``candidates`` holds the tests of all orders that were tried.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import ResponseEstimate, fit_rational_model
    >>> rng, frequency = np.random.default_rng(0), np.geomspace(0.05, 5, 60)
    >>> exact = 3.0 / (2j * np.pi * frequency + 2.0)
    >>> noise = 1e-3 * rng.standard_normal((60, 2)) @ [1, 1j]
    >>> variance = np.full((60, 1, 1), 2e-6)
    >>> measured = ResponseEstimate(frequency, (exact + noise)[:, None, None], variance, np.inf)
    >>> found = fit_rational_model(measured, orders=1, excess=1)
    >>> found.certificate.valid, sorted(found.candidates)
    (True, [1])
    """

    model: CommonPoleModel
    uncertainty: ModelUncertainty
    tests: ResidualTests
    candidates: dict[int, ResidualTests]

    def summary(self) -> str:
        p, m = self.model.shape
        verdict = "accepted" if self.tests.accepted else "rejected"
        return (
            f"RationalModelEstimate: order {self.model.order}, {p} outputs, {m} inputs; cost "
            f"{self.tests.cost:.4g}, expected {self.tests.expected:.4g}: {verdict}"
        )

    @property
    def lti(self) -> StateSpace:
        """A realisation of the rational part, without the delays."""
        return self.model.lti

    def response(self, omega: ArrayLike) -> ComplexArray:
        """Responses (F, p, m) at omega [rad/s]."""
        return self.model.response(omega)

    def magnitude_band(self, omega: ArrayLike, *, confidence: float = 0.95) -> RealArray:
        """Half-widths (F, p, m) of intervals of the magnitudes."""
        return self.uncertainty.magnitude_band(omega, confidence=confidence)

    def radius(self, omega: ArrayLike, *, confidence: float = 0.95) -> RealArray:
        """Radii (F, p, m) of discs that contain the true responses."""
        return self.uncertainty.radius(omega, confidence=confidence)

    def plot(self, name: str | None = None, *, confidence: float = 0.95) -> Figure:
        """Data and model over frequency, with the confidence band of the model.

        With a name: the figure of that name of its Program.
        """
        if name is not None:
            return super().plot(name)
        data = self.uncertainty.structure.data
        return rational_model_figure(data, self.model, self.uncertainty, confidence)


def fit_rational_model(
    estimate: ResponseEstimate,
    *,
    orders: int | Sequence[int] = (2, 4, 6, 8),
    excess: Any = 0,
    dt: float | None = None,
    stable: bool = False,
    delay: Any = 0.0,
    delay_bounds: tuple[float, float] | None = None,
    method: str = "levenberg-marquardt",
    options: Options | None = None,
) -> RationalModelEstimate:
    """Rational model of a measured response, each datum weighted by its variance.

    Parameters
    ----------
    estimate
        The response. If it has a covariance between its entries, and enough periods were averaged,
        the entries are weighted together; otherwise each entry by its variance.
    orders
        Numbers of poles to choose from, or a single number to use.
    excess, dt, stable
        The same as for `RationalModelFit`.
    delay, delay_bounds
        Known delay [s], and bounds of a delay to be fitted, as for `RationalModelFit`.
    method
        ``"levenberg-marquardt"``, ``"instruments"`` or ``"ipopt"``.
    options
        Time limit for the method.

    Raises
    ------
    InputError
        The same as for `RationalModelFit`.
    SolverError
        No valid answer; the message says which check fails.

    Warns
    -----
    IdentificationWarning
        No order is accepted: then bands from the variance alone are too narrow.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import ResponseEstimate, fit_rational_model
    >>> rng, frequency = np.random.default_rng(0), np.geomspace(0.05, 5, 60)
    >>> exact = 3.0 / (2j * np.pi * frequency + 2.0)
    >>> noise = 1e-3 * rng.standard_normal((60, 2)) @ [1, 1j]
    >>> variance = np.full((60, 1, 1), 2e-6)
    >>> measured = ResponseEstimate(frequency, (exact + noise)[:, None, None], variance, np.inf)
    >>> found = fit_rational_model(measured, orders=[1, 2], excess=1)
    >>> found.model.order, found.model.poles.real.round(2).tolist()
    (1, [-2.0])
    """
    tried = [int(orders)] if isinstance(orders, int | np.integer) else list(orders)
    program = RationalModelFit(
        estimate.omega,
        estimate.response,
        _weighting(estimate),
        orders=tried,
        excess=excess,
        dt=dt,
        stable=stable,
        delay=delay,
        delay_bounds=delay_bounds,
        degrees=estimate.degrees,
        report=estimate.report,
    )
    solution = solve(program, method=method, options=options)
    if solution.certificate is None or not solution.certificate.valid:
        failures = () if solution.certificate is None else solution.certificate.failures
        raise SolverError("; ".join([f"{method}: {solution.message}", *failures]))
    answer = solution.answer
    tests = program.tests(answer.model)
    if not tests.accepted:
        warnings.warn(program.facts(answer)[0], IdentificationWarning, stacklevel=2)
    return RationalModelEstimate(
        answer.model,
        program.uncertainty(answer.model),
        tests,
        {model.order: program.tests(model) for model in answer.models},
    ).with_checker(OriginalAnswerChecker(program, answer), certificate=solution.certificate)


def _weighting(estimate: ResponseEstimate) -> np.ndarray:
    """Covariance matrices if they are known well enough, otherwise variances."""
    covariance = getattr(estimate, "covariance", None)
    entries = estimate.response[0].size
    if covariance is None or estimate.degrees < DEGREES_PER_ENTRY * entries:
        return estimate.variance
    return np.asarray(covariance)
