"""Rational models of measured responses by least squares weighted with the variance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from workbench._core.arrays import ComplexArray
from workbench._core.heavy_types import Dataset, Figure
from workbench._core.tables import markdown_table
from workbench.certificate import THIS_SYSTEM, Check, quantified_checks
from workbench.errors import InputError
from workbench.identification.rational_models import figures as drawn
from workbench.identification.rational_models.model import CommonPoleModel
from workbench.identification.rational_models.optimality import fall_nearby, movement
from workbench.identification.rational_models.residual_tests import (
    ResidualTests,
    bayes_criterion,
    least_degrees,
    residual_tests,
)
from workbench.identification.rational_models.storage import (
    RationalModels,
    about_response,
    restored_model,
    stored_model,
)
from workbench.identification.rational_models.structure import ModelStructure
from workbench.identification.rational_models.uncertainty import ModelUncertainty
from workbench.identification.rational_models.weighted import WeightedResponse
from workbench.identification.record_tests.report import RecordReport
from workbench.input_checks import as_array, need_positive
from workbench.program import Program
from workbench.second_opinion import SEED
from workbench.second_opinion.fits import decays, realisation_agrees

MOVEMENT_LIMIT = 1e-2
"""Largest distance of a valid answer from its optimum, in standard deviations of the estimates."""
MISFIT_SHARE, ROUNDING_SHARE = 1e-3, 1e-9
"""The same limit as fractions of the norm of the residuals and of the whitened response; the
largest limit counts.
"""
COST_RISE = 1e-6
"""Relative rise of the cost from one order to the next that counts as rounding."""


@dataclass(frozen=True, eq=False)
class RationalModelFit(Program):
    """Models G = N / d exp(-s delay) with one denominator for all entries, by likelihood.

    The model of each order minimises the sum of (G - response)^H covariance^-1 (G - response) over
    the frequencies: this is maximum likelihood if the errors are normal, circular and independent
    between frequencies. The chosen order is the lowest that is rejected neither by the cost nor by
    a correlation of the residuals; if all are rejected, the one with the least Bayesian information
    criterion. The cost may have several minima, and no method claims the best one.

    Parameters
    ----------
    omega
        Frequencies (F,) [rad/s], rising.
    response
        Complex responses (F, p, m), or (F,) of a single entry.
    covariance
        The same as for `WeightedResponse`: variances (F, p, m), or matrices (F, p m, p m).
    orders
        Numbers of poles to choose from.
    excess
        Number of poles minus number of zeros, one number or (p, m).
    dt
        Sampling time [s] of a model in z = exp(s T); None: a model in s.
    stable
        Whether every pole must be stable.
    delay
        Known delay [s], one number or (p, m).
    delay_bounds
        Bounds [s] of a further delay that all entries share, which is fitted; None: there is none.
    degrees
        Real degrees of freedom of the covariance, 2 (M - 1) from M periods; infinite if it is known
        exactly.
    report
        Report of the record from which the response was estimated, if there is one.

    Raises
    ------
    InputError
        As `WeightedResponse`; orders that the data do not determine or that are below the excess;
        frequencies above half the sampling rate; or other values out of range.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.identification import RationalModelFit
    >>> rng, omega = np.random.default_rng(0), np.geomspace(0.2, 30, 60)
    >>> noise = 1e-3 * rng.standard_normal((60, 2)) @ [1, 1j]
    >>> program = RationalModelFit(
    ...     omega, 3 / (1j * omega + 2) + noise, np.full((60, 1, 1), 2e-6), orders=[1, 2], excess=1
    ... )
    >>> solution = wb.solve(program)
    >>> solution.certificate.valid, solution.answer.model.order
    (True, 1)
    """

    omega: Any
    response: Any
    covariance: Any
    _: KW_ONLY
    orders: Sequence[int] = (2, 4, 6)
    excess: Any = 0
    dt: float | None = None
    stable: bool = False
    delay: Any = 0.0
    delay_bounds: tuple[float, float] | None = None
    degrees: float = np.inf
    report: RecordReport | None = field(default=None, kw_only=True)

    default_method: ClassVar[str] = "levenberg-marquardt"
    methods_in: ClassVar[tuple[str, ...]] = ("workbench.identification.rational_models.methods",)
    headline: ClassVar[str] = "cost_ratio"

    def __post_init__(self) -> None:
        data = self.structure.data
        given = list(self.orders)
        if not given or any(isinstance(n, bool) or int(n) != n or n < 0 for n in given):
            raise InputError(f"orders must be whole numbers, 0 or more, not {self.orders!r}")
        object.__setattr__(self, "orders", tuple(sorted({int(n) for n in given})))
        if self.orders[0] < self.structure.excess.max():
            raise InputError(
                f"order {self.orders[0]} is below the excess of {self.structure.excess.max()} "
                "poles over zeros"
            )
        most = self.structure.unknowns(self.orders[-1])
        if most >= data.count:
            raise InputError(
                f"order {self.orders[-1]} has {most} coefficients, and the data are {data.count} "
                "real numbers: lower it, or give more frequencies"
            )
        if not self.degrees > least_degrees(self.jointly_whitened):
            raise InputError(
                f"degrees is {self.degrees}; more than {least_degrees(self.jointly_whitened):g} "
                f"are needed to weight {self.jointly_whitened} entries together: average more "
                "periods, or give variances instead of matrices"
            )

    @cached_property
    def structure(self) -> ModelStructure:
        """Structure of the models, with the data."""
        data = WeightedResponse(self.omega, self.response, self.covariance)
        excess = as_array(self.excess, "excess")
        if (
            excess.shape not in ((), data.shape)
            or not ((excess >= 0) & (excess == np.round(excess))).all()
        ):
            raise InputError(
                f"excess must be a whole number, 0 or more, or {data.shape} of them, not "
                f"{self.excess!r}"
            )
        need_positive(self.dt, "dt", or_none=True)
        if self.dt is not None and data.omega[-1] * self.dt > np.pi * (1 + 1e-9):
            raise InputError(
                f"the highest frequency, {data.omega[-1]:.6g} rad/s, is above half the sampling "
                f"rate, {np.pi / self.dt:.6g} rad/s"
            )
        delay = as_array(self.delay, "delay")
        if delay.shape not in ((), data.shape) or not (np.isfinite(delay) & (delay >= 0)).all():
            raise InputError(
                f"delay must be finite and not negative, one number or {data.shape}, not "
                f"{self.delay!r}"
            )
        return ModelStructure(
            data,
            np.broadcast_to(excess.astype(int), data.shape),
            self.dt,
            bool(self.stable),
            np.broadcast_to(delay, data.shape),
            _bounds(self.delay_bounds),
        )

    @property
    def jointly_whitened(self) -> int:
        """Number of entries whose errors are whitened together."""
        data = self.structure.data
        return 1 if data.independent else data.response[0].size

    @property
    def problem_size(self) -> float:
        """Number of real data."""
        return float(self.structure.data.count)

    # --- the fits ---------------------------------------------------------------------------------

    def residual(self, model: CommonPoleModel) -> ComplexArray:
        """Whitened residuals (F, p, m) of a model."""
        data = self.structure.data
        return data.whitened(model.response(data.omega) - data.response)

    def tests(self, model: CommonPoleModel) -> ResidualTests:
        """Cost and whiteness of a model."""
        unknowns = self.structure.unknowns(model.order)
        return residual_tests(self.residual(model), unknowns, self.degrees, self.jointly_whitened)

    def choose(self, models: Sequence[CommonPoleModel]) -> int:
        """Index of the first accepted model, or of the one with the least criterion."""
        tests = [self.tests(model) for model in models]
        for number, each in enumerate(tests):
            if each.accepted:
                return number
        count = self.structure.data.count
        scores = [
            bayes_criterion(test, count, self.structure.unknowns(model.order))
            for test, model in zip(tests, models, strict=True)
        ]
        return int(np.argmin(scores))

    def uncertainty(self, model: CommonPoleModel) -> ModelUncertainty:
        """Distribution of the estimates about a fitted model.

        Zeros at infinity are taken as known if a delay is fitted, since it has the same effect.
        """
        structure = self.structure
        counts = np.array([[entry.zeros.size for entry in row] for row in model.entries])
        if structure.free_delay and (counts < model.order - structure.excess).all():
            structure = replace(structure, excess=model.order - counts)
        return ModelUncertainty(structure, model, degrees=self.degrees)

    def objective(self, answer: RationalModels) -> float:
        """The cost of the chosen model."""
        return float(np.sum(np.abs(self.residual(answer.model)) ** 2))

    def objective_rounding(self, answer: RationalModels) -> float:
        """Square of the residual norm that a fit of exact data may leave."""
        return float((ROUNDING_SHARE * self.structure.data.size) ** 2)

    # --- checks -----------------------------------------------------------------------------------

    def checks(self, answer: RationalModels, tolerance: float) -> Sequence[Check]:
        structure = self.structure
        wrong = abs(len(answer.models) - len(self.orders)) + sum(
            self._misshapen(model, order)
            for model, order in zip(answer.models, self.orders, strict=False)
        )
        shape = Check(
            "structure", "models with other orders, zeros, delays or sizes", float(wrong), 0.0
        )
        if wrong:
            return quantified_checks(self._data_words, [shape])
        found = [shape]
        # An order above the chosen one may have no minimum: a pole that a zero cancels can be
        # anywhere. Such orders are not checked.
        models = answer.models[: answer.chosen + 1]
        costs = [float(np.sum(np.abs(self.residual(model)) ** 2)) for model in models]
        moves = [
            movement(structure, model) / self._ground(cost)
            for model, cost in zip(models, costs, strict=True)
        ]
        worst = int(np.argmax(np.nan_to_num(moves, nan=np.inf)))
        found.append(
            Check(
                "stationary",
                "movement to the optimum, in standard deviations of the estimates (1e-3 of the "
                "residuals' norm or 1e-9 of the data's, where that is more)",
                moves[worst],
                MOVEMENT_LIMIT,
                where=f"of order {self.orders[worst]}",
            )
        )
        rises = [
            (cost - min(costs[:k])) / (min(costs[:k]) + self.objective_rounding(answer))
            for k, cost in enumerate(costs)
            if k
        ]
        if rises:
            worst = int(np.argmax(np.nan_to_num(rises, nan=np.inf)))
            statement = "rise of the cost from a lower order, relative"
            where = f"to order {self.orders[worst + 1]}"
            found.append(Check("nested", statement, rises[worst], COST_RISE, where=where))
        chosen = self.choose(answer.models)
        statement = "number of the order less that of the one to be chosen, absolute"
        found.append(Check("chosen", statement, float(abs(answer.chosen - chosen)), 0.0))
        if self.stable:
            unstable = sum(not model.is_stable for model in answer.models)
            words = "models with a pole that is not stable"
            found.append(Check("stable", words, float(unstable), 0.0, over=THIS_SYSTEM))
        return quantified_checks(self._data_words, found)

    @property
    def _data_words(self) -> str:
        return f"for these data at {self.structure.data.omega.size} frequencies"

    def _misshapen(self, model: CommonPoleModel, order: int) -> int:
        """1 if a model has another structure than the one asked for, otherwise 0."""
        structure = self.structure
        right = model.shape == structure.data.shape and model.dt == self.dt
        right = right and model.order == order
        if right:
            right = all(
                model.entries[i][j].zeros.size <= structure.degree(i, j, order)
                for i, j in np.ndindex(model.shape)
            )
            low, high = structure.delay_bounds or (0.0, 0.0)
            extra = model.delay - structure.delay
            slack = 1e-12 * max(high, float(np.abs(structure.delay).max()))
            right = right and bool(
                (extra >= low - slack).all()
                and (extra <= high + slack).all()
                and np.ptp(extra) <= slack
            )
        return int(not right)

    def _ground(self, cost: float) -> float:
        """Size below which a movement is meaningless because of noise, misfit or rounding."""
        misfit = MISFIT_SHARE * np.sqrt(max(cost, 0.0))
        return max(1.0, float(misfit), ROUNDING_SHARE / MOVEMENT_LIMIT * self.structure.data.size)

    def second_opinion(self, answer: RationalModels) -> Sequence[Check]:
        model, data = answer.model, self.structure.data
        system = model.lti
        turn = np.exp(-1j * data.omega[:, None, None] * model.delay)
        fitted = model.response(data.omega) / turn
        found = [
            realisation_agrees(
                system[i, j], data.omega, fitted[:, i, j], np.abs(data.response[:, i, j])
            )
            for i, j in np.ndindex(model.shape)
        ]
        agrees = max(found, key=lambda check: check.value)
        cost = float(np.sum(np.abs(self.residual(model)) ** 2))
        fall = fall_nearby(self.residual, model, self.structure, np.random.default_rng(SEED))
        statement = "root of the largest fall of the cost at models drawn nearby (units as above)"
        near = Check("neighbours", statement, fall / self._ground(cost), 2 * MOVEMENT_LIMIT)
        checks = [agrees, *quantified_checks(self._data_words, [near])]
        if self.stable and model.order:
            checks.append(decays(system, "model decays"))
        return checks

    # --- numbers, tables, figures -----------------------------------------------------------------

    def metrics(self, answer: RationalModels) -> dict[str, float]:
        tests = self.tests(answer.model)
        found = {
            "order": float(answer.model.order),
            "cost": tests.cost,
            "cost_ratio": tests.cost / tests.expected,
            "cost_p": tests.cost_p,
            "whiteness_p": tests.whiteness_p,
        }
        if self.delay_bounds is not None:
            found["delay"] = float(np.mean(answer.model.delay - self.structure.delay))
        return found

    def facts(self, answer: RationalModels) -> Sequence[str]:
        tests, told = self.tests(answer.model), self.report.sentences if self.report else ()
        if tests.accepted:
            return [f"order {answer.model.order} is accepted by its cost and its residuals", *told]
        return [
            f"no order is accepted: at order {answer.model.order} the cost is "
            f"{tests.cost / tests.expected:.4g} times the expected one, so that bands by the "
            "variance alone are too narrow",
            *told,
        ]

    def tables(self, answer: RationalModels) -> dict[str, str]:
        rows = []
        for model in answer.models:
            tests = self.tests(model)
            rows.append(
                (
                    model.order,
                    self.structure.unknowns(model.order),
                    f"{tests.cost:.6g}",
                    f"{tests.expected:.6g}",
                    f"{tests.cost_p:.2g}",
                    f"{tests.whiteness_p:.2g}",
                    "chosen" if model is answer.model else "",
                )
            )
        head = ["order", "coefficients", "cost", "expected", "p of cost", "p of whiteness", ""]
        return {"orders": markdown_table(head, rows)}

    def figures(self, answer: RationalModels) -> dict[str, Figure]:
        data, model = self.structure.data, answer.model
        return {
            "response": drawn.rational_model_figure(data, model, self.uncertainty(model)),
            "residuals": drawn.rational_residual_figure(data, self.residual(model)),
        }

    def to_dataset(self, answer: RationalModels) -> Dataset:
        import xarray as xr

        data = self.structure.data
        grid = ("omega", "output", "input")
        model = answer.model
        variables: dict[str, Any] = {
            "response": (grid, data.response, about_response("measured response")),
            "deviation": (grid, data.deviation, about_response("standard deviation of its error")),
            "fit": (
                grid,
                model.response(data.omega),
                about_response("response of the chosen model"),
            ),
            "band": (
                grid,
                self.uncertainty(model).magnitude_band(data.omega),
                about_response("half-width of the 95 % band of its magnitude"),
            ),
            "chosen": ((), answer.chosen),
        }
        for each in answer.models:
            variables |= stored_model(each)
        axis = ("omega", data.omega, {"units": "rad/s", "long_name": "angular frequency"})
        return xr.Dataset(variables, {"omega": axis})

    def from_dataset(self, data: Dataset) -> RationalModels:
        models = tuple(restored_model(data, order, self.dt) for order in self.orders)
        return RationalModels(models, int(data["chosen"]))


def _bounds(given: Any) -> tuple[float, float] | None:
    """Bounds of a delay [s] as two rising numbers; raises `InputError` for others."""
    if given is None:
        return None
    values = as_array(given, "delay_bounds")
    if values.shape != (2,) or not (np.isfinite(values).all() and 0 <= values[0] < values[1]):
        raise InputError(f"delay_bounds must be two rising numbers from 0 on [s], not {given!r}")
    return float(values[0]), float(values[1])
