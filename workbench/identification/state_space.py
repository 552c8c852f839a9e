"""State-space models of a record: the order chosen in its first part, judged on the rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from workbench.errors import InputError
from workbench.executor import Context
from workbench.identification import state_space_figures as drawn
from workbench.identification.innovations import InnovationsModel, Real, checked_record
from workbench.identification.local_polynomial import LocalPolynomial, local_polynomial
from workbench.identification.prediction_error import refine
from workbench.identification.subspace import HORIZONS, best_subspace, order_fits
from workbench.identification.validation import (
    autocorrelation,
    cross_correlation,
    nrmse_fit,
    share_outside,
)
from workbench.program import Check, Claim, Program, method
from workbench.solvers import Outcome

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

KINDS = ("one_step", "free_run")
MATRICES = {
    "A": ("state", "state_"), "B": ("state", "input"), "C": ("output", "state"),
    "D": ("output", "input"), "K": ("state", "output"),
    "u_offset": ("input",), "y_offset": ("output",),
}  # fmt: skip
LAGS = 25
"""Lags of the residual tests."""
VALIDATED = 1 / 3
"""Share of the estimation part that an order is validated on, once at its end, once at its start:
both folds leave one unbroken record to estimate from."""

Fit = Callable[[Real, Real], InnovationsModel | None]
"""From a record u (N, nu), y (N, ny) to a model; None where the method finds no stable one."""


@dataclass(frozen=True, eq=False)
class Identified:
    """A model and the validation fits [%] that chose its order, (orders, kinds, ny)."""

    model: InnovationsModel
    scores: Real


@dataclass(frozen=True, eq=False)
class StateSpaceFit(Program):
    """A linear model of a record in innovations form, with its noise.

    Only the first `estimation` samples may be used to estimate and to choose the order; the rest
    judges, once. Wherever a model is judged, its initial state comes from the first `washout`
    samples, which are left out of the score.

    Parameters
    ----------
    u, y
        Inputs (N, nu) and outputs (N, ny), one row per sample.
    estimation
        Samples that methods may use.
    orders
        Numbers of states to choose from.
    washout
        Samples that an initial state is estimated from.
    simulation_weight
        Weight of free-run errors beside one-step errors in the prediction-error method.

    Raises
    ------
    InputError
        NaN or a dead channel in the record, too few samples for washout or orders.
    """

    u: Real
    y: Real
    estimation: int
    orders: tuple[int, ...] = (2, 4, 6, 8)
    washout: int = 50
    simulation_weight: float = 0.1
    title: str = field(default="record", kw_only=True)

    default_method: ClassVar[str] = "prediction-error"
    headline: ClassVar[str] = "fit_free_run_y1"

    def __post_init__(self) -> None:
        u, y = checked_record(self.u, self.y)
        object.__setattr__(self, "u", u)
        object.__setattr__(self, "y", y)
        object.__setattr__(self, "orders", tuple(sorted(set(self.orders))))
        shortest = min(round(self.estimation * VALIDATED), len(u) - self.estimation)
        if shortest <= self.washout + LAGS or self.washout < 1:
            raise InputError(
                f"{len(u)} samples with {self.estimation} for estimation leave parts of {shortest} "
                f"to judge on; more than washout + {LAGS} = {self.washout + LAGS} are needed: "
                "take a longer record or a shorter washout"
            )
        if not self.orders:
            raise InputError("no orders to choose from; give at least one")
        samples = self.estimation - round(self.estimation * VALIDATED)
        for order in (self.orders[0], self.orders[-1]):
            self._refuse_order(order, samples)

    def _refuse_order(self, order: int, samples: int) -> None:
        nu, ny = self.u.shape[1], self.y.shape[1]
        parameters = order * (2 * ny + nu) + ny * nu
        known = any(order_fits(order, past, samples, nu, ny) for past in HORIZONS)
        if not known or 4 * parameters > samples * ny:
            raise InputError(
                f"order {order} does not fit the data: its {parameters} free parameters would be "
                f"estimated from {samples * ny} output samples, and at least four times as many "
                "as parameters are needed; choose lower orders (at least 1) or a longer record"
            )

    def validate(self, fit: Fit) -> Real:
        """Mean fits [%] of a way of fitting over the folds of the estimation part, (kinds, ny).

        Minus infinity where it finds no stable model.
        """
        u, y = self.u[: self.estimation], self.y[: self.estimation]
        cut = round(self.estimation * VALIDATED)
        folds = ((slice(None, -cut), slice(-cut, None)), (slice(cut, None), slice(None, cut)))
        total = np.zeros((len(KINDS), y.shape[1]))
        for used, left in folds:
            model = fit(u[used], y[used])
            if model is None:
                return np.full_like(total, -np.inf)
            total += self.fits(model, u[left], y[left]) / len(folds)
        return total

    def fits(self, model: InnovationsModel, u: Real, y: Real) -> Real:
        """One-step and free-run fit of each output [%] on a record without its washout, (2, ny)."""
        runs = (model.one_step, model.free_run)
        rows = [
            nrmse_fit(y[self.washout :], run(u, y, self.washout)[self.washout :]) for run in runs
        ]
        return np.array(rows)

    def identify(self, fit: Callable[[int], Fit], context: Context) -> Identified | None:
        """Validate every order, take the one of the best mean fit, and fit it to all that may be
        used; None where no order gives a stable model."""
        tried = context.track(self.orders, "orders")
        scores = np.array([self.validate(fit(order)) for order in tried])
        model = None
        means = scores.mean(axis=(1, 2))
        for place in np.argsort(-means, kind="stable"):
            if model is None and np.isfinite(means[place]):
                used = slice(None, self.estimation)
                model = fit(self.orders[place])(self.u[used], self.y[used])
        return None if model is None else Identified(model, scores)

    @cached_property
    def nonparametric(self) -> LocalPolynomial:
        """Response of the estimation part without a model."""
        return local_polynomial(self.u[: self.estimation], self.y[: self.estimation])

    def checks(self, answer: Identified, tolerance: float) -> list[Check]:
        model, rest = answer.model, slice(self.estimation, None)
        missed = 1 - self.fits(model, self.u[rest], self.y[rest]) / 100
        return [
            Check("stable", "spectral radius of A", model.radius, 1.0),
            Check("stable predictor", "spectral radius of A - K C", model.predictor_radius, 1.0),
            *(
                Check(
                    kind.replace("_", " "),
                    "error on the samples held out, over that of the mean",
                    float(np.max(row)),
                    1.0,
                    f"of y{int(np.argmax(row)) + 1}",
                )
                for kind, row in zip(KINDS, missed, strict=True)
            ),
        ]

    def metrics(self, answer: Identified) -> dict[str, float]:
        parts = {"": slice(self.estimation, None), "estimation_": slice(None, self.estimation)}
        numbers: dict[str, float] = {}
        for part, used in parts.items():
            fits = self.fits(answer.model, self.u[used], self.y[used])
            for kind, row in zip(KINDS, fits, strict=True):
                numbers |= {f"{part}fit_{kind}_y{i + 1}": float(v) for i, v in enumerate(row)}
        own, crossed = self.residual_tests(answer.model)
        return numbers | {
            "order": float(answer.model.order),
            "residual_autocorrelations_outside": share_outside(own),
            "residual_input_correlations_outside": share_outside(crossed[LAGS:]),
        }

    def residual_tests(self, model: InnovationsModel) -> tuple[Real, Real]:
        """`autocorrelation` and `cross_correlation` of one-step errors on the samples held out."""
        u, y = self.u[self.estimation :], self.y[self.estimation :]
        errors = (y - model.one_step(u, y, self.washout))[self.washout :]
        return autocorrelation(errors, LAGS), cross_correlation(errors, u[self.washout :], LAGS)

    def tables(self, answer: Identified) -> dict[str, str]:
        outputs = range(1, self.y.shape[1] + 1)
        heads = [f"{kind.replace('_', ' ')} y{i} [%]" for kind in KINDS for i in outputs]
        lines = [
            "| order | " + " | ".join(heads) + " | mean [%] |",
            "| ---: |" + " ---: |" * (len(heads) + 1),
        ]
        for order, score in zip(self.orders, answer.scores, strict=True):
            cells = " | ".join(f"{x:.2f}" for x in (*score.ravel(), score.mean()))
            lines.append(f"| {order} | {cells} |")
        return {"validation": "\n".join(lines) + "\n"}

    def figures(self, answer: Identified) -> dict[str, Figure]:
        data = self.to_dataset(answer)
        return {
            "held-out": drawn.held_out(data, self.title),
            "response": drawn.response(data, self.title),
            "residuals": drawn.residuals(data),
            "validation": drawn.validation(data),
        }

    def to_dataset(self, answer: Identified) -> xr.Dataset:
        import xarray as xr

        model, estimate = answer.model, self.nonparametric
        u, y = self.u[self.estimation :], self.y[self.estimation :]
        grid = ("frequency", "output", "input")
        own, crossed = self.residual_tests(model)
        held = ("time", "output")
        return xr.Dataset(
            {
                **{name: (dims, getattr(model, name)) for name, dims in MATRICES.items()},
                "validation_fit": (("order", "kind", "output"), answer.scores, {"units": "%"}),
                "measured": (held, y, {"long_name": "held-out record"}),
                "one_step": (held, model.one_step(u, y, self.washout)),
                "free_run": (held, model.free_run(u, y, self.washout)),
                "response": (grid, model.response(estimate.frequency)),
                "nonparametric": (grid, estimate.response),
                "variance": (grid, estimate.variance, {"long_name": "of nonparametric"}),
                "autocorrelation": (("lag", "output"), own, {"units": "standard deviations"}),
                "cross_correlation": (
                    ("shift", "output", "input"),
                    crossed,
                    {"units": "standard deviations"},
                ),
            },
            coords={
                "input": [f"u{i + 1}" for i in range(u.shape[1])],
                "output": [f"y{i + 1}" for i in range(y.shape[1])],
                "order": list(self.orders),
                "kind": list(KINDS),
                "time": ("time", np.arange(self.estimation, len(self.u)), {"units": "samples"}),
                "frequency": ("frequency", estimate.frequency, {"units": "cycles/sample"}),
                "lag": ("lag", np.arange(1, LAGS + 1), {"units": "samples"}),
                "shift": ("shift", np.arange(-LAGS, LAGS + 1), {"units": "samples"}),
            },
            attrs={"washout": self.washout},
        )

    def from_dataset(self, data: xr.Dataset) -> Identified:
        matrices = {name: data[name].values for name in MATRICES}
        return Identified(InnovationsModel(**matrices), data["validation_fit"].values)


def _claim(answer: Identified | None) -> Claim:
    if answer is None:
        return None, Outcome.FAILED, "no order gives a stable model with a stable predictor"
    return answer, Outcome.SOLVED, f"order {answer.model.order}"


@method(StateSpaceFit, "subspace", optimal=False)
def _subspace(program: StateSpaceFit, context: Context) -> Claim:
    """Predictor-based subspace identification; no iterations."""

    def fit(order: int) -> Fit:
        return lambda u, y: best_subspace(u, y, order)

    return _claim(program.identify(fit, context))


@method(StateSpaceFit, "prediction-error", optimal=False)
def _prediction_error(program: StateSpaceFit, context: Context) -> Claim:
    """Prediction errors minimised from the subspace model; exact gradients."""

    def fit(order: int) -> Fit:
        def refined(u: Real, y: Real) -> InnovationsModel | None:
            start = best_subspace(u, y, order)
            return start and refine(start, u, y, program.simulation_weight)[0]

        return refined

    return _claim(program.identify(fit, context))
