"""State-space models of a record, one to predict and one to simulate it.

Prediction and simulation are two uses of a model. If a record is not quite linear, no model of low
order is best at both: one-step prediction can treat slow errors of the plant model as noise, a
simulation cannot. So each use has its own model, estimated by the criterion of that use, with the
order that validates best in it. Both are chosen in the first part of the record and judged on the
rest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from workbench.arrays import RealArray
from workbench.certificate import THIS_SYSTEM, Check
from workbench.errors import InputError
from workbench.heavy_types import Dataset, Figure, StateSpace
from workbench.identification.experiments.quality import checked_record
from workbench.identification.responses.local_polynomial import LocalPolynomial, local_polynomial
from workbench.identification.state_space import figures as drawn
from workbench.identification.state_space.innovations import InnovationsModel
from workbench.identification.state_space.subspace import HORIZONS, order_fits
from workbench.identification.state_space.validation import (
    autocorrelation,
    cross_correlation,
    nrmse_fit,
    share_outside,
)
from workbench.input_checks import need_positive
from workbench.program import Program
from workbench.second_opinion.fits import decays
from workbench.second_opinion.records import convolved
from workbench.tables import markdown

USES = ("one_step", "free_run")
"""Uses of the predictor and of the simulator; each is also the name of a method of the model."""
MODELS = ("predictor", "simulator")
"""Model for each of the uses."""
MATRICES = {
    "A": ("{}_state", "{}_state_"), "B": ("{}_state", "input"), "C": ("output", "{}_state"),
    "D": ("output", "input"), "K": ("{}_state", "output"),
    "u_offset": ("input",), "y_offset": ("output",),
}  # fmt: skip
"""Matrices of a model, each with its dimensions in a dataset."""
RESIDUAL_LAGS = 25
"""Number of lags in the tests of residuals."""
VALIDATION_SHARE = 1 / 3
"""Share of the estimation part on which an order is validated, once at its end, once at its start.

So both folds leave one unbroken record for the estimation.
"""

CONVOLUTION_ROUNDING = 1e-6
"""Largest difference of the free-run error by convolution and by simulation."""

Fitter = Callable[[RealArray, RealArray], InnovationsModel | None]
"""Function of a record u (N, nu), y (N, ny) that gives a stable model, or None."""


@dataclass(frozen=True, eq=False)
class IdentifiedModels:
    """A model for each use, and the validation fits that chose their orders.

    ``scores`` (uses, orders, ny) [%] holds one-step fits of predictors and free-run fits of
    simulators. ``sample_time`` [s] is the record's.
    """

    predictor: InnovationsModel
    simulator: InnovationsModel
    scores: RealArray
    sample_time: float = 1.0

    @property
    def lti(self) -> StateSpace:
        """The simulator's system from u to y, at the record's sampling time."""
        import control

        return control.ss(*(getattr(self.simulator, part) for part in "ABCD"), self.sample_time)


@dataclass(frozen=True, eq=False)
class StateSpaceFit(Program):
    """Linear models of a record in innovations form: one to predict it, one to simulate it.

    The predictor has the order of the best one-step fit in validation, the simulator that of the
    best free-run fit. The prediction-error method weights free-run errors only for the simulator.
    One-step fits are always those of the predictor, free-run fits those of the simulator.

    Methods may use only the first `estimation` samples, to estimate and to choose the orders; the
    remaining samples are used once, to judge the answer. Wherever a model is judged, its initial
    state is estimated from the first `washout` samples, which do not count in the score.

    Parameters
    ----------
    u, y
        Inputs (N, nu) and outputs (N, ny), one row per sample.
    estimation
        Number of samples that methods may use.
    orders
        Numbers of states to choose from.
    washout
        Number of samples from which an initial state is estimated.
    title
        Title of figures.
    sample_time
        Sampling time of the record [s], for the systems of the answer.

    Raises
    ------
    InputError
        NaN or a dead channel in the record, or too few samples for the washout or the orders.
    """

    u: RealArray
    y: RealArray
    estimation: int
    orders: tuple[int, ...] = (2, 4, 6, 8)
    washout: int = 50
    title: str = field(default="record", kw_only=True)
    sample_time: float = field(default=1.0, kw_only=True)

    default_method: ClassVar[str] = "prediction-error"
    headline: ClassVar[str] = "fit_free_run_y1"

    def __post_init__(self) -> None:
        need_positive(self.sample_time, "sample_time")
        u, y = checked_record(self.u, self.y)
        object.__setattr__(self, "u", u)
        object.__setattr__(self, "y", y)
        object.__setattr__(self, "orders", tuple(sorted(set(self.orders))))
        shortest = min(round(self.estimation * VALIDATION_SHARE), len(u) - self.estimation)
        if shortest <= self.washout + RESIDUAL_LAGS or self.washout < 1:
            raise InputError(
                f"{len(u)} samples with {self.estimation} for estimation leave parts of {shortest} "
                f"to judge on; more than washout + {RESIDUAL_LAGS} = "
                f"{self.washout + RESIDUAL_LAGS} are needed: "
                "take a longer record or a shorter washout"
            )
        if not self.orders:
            raise InputError("no orders to choose from; give at least one")
        samples = self.estimation - round(self.estimation * VALIDATION_SHARE)
        for order in (self.orders[0], self.orders[-1]):
            self._refuse_order(order, samples)

    def _refuse_order(self, order: int, samples: int) -> None:
        """Raise `InputError` if so many samples do not determine models of an order."""
        nu, ny = self.u.shape[1], self.y.shape[1]
        parameters = order * (2 * ny + nu) + ny * nu
        known = any(order_fits(order, past, samples, nu, ny) for past in HORIZONS)
        if not known or 4 * parameters > samples * ny:
            raise InputError(
                f"order {order} does not fit the data: its {parameters} free parameters would be "
                f"estimated from {samples * ny} output samples, and at least four times as many "
                "as parameters are needed; choose lower orders (at least 1) or a longer record"
            )

    def validate(self, fit: Fitter) -> RealArray:
        """Mean validation fits (uses, ny) [%] of a fitting function, over both folds.

        They are minus infinity if it finds no stable model.
        """
        u, y = self.u[: self.estimation], self.y[: self.estimation]
        cut = round(self.estimation * VALIDATION_SHARE)
        folds = ((slice(None, -cut), slice(-cut, None)), (slice(cut, None), slice(None, cut)))
        total = np.zeros((len(USES), y.shape[1]))
        for used, left in folds:
            model = fit(u[used], y[used])
            if model is None:
                return np.full_like(total, -np.inf)
            total += self.fits(model, model, u[left], y[left]) / len(folds)
        return total

    def fits(
        self, predictor: InnovationsModel, simulator: InnovationsModel, u: RealArray, y: RealArray
    ) -> RealArray:
        """Fits (uses, ny) [%] of each output on a record, without its washout.

        They are one-step fits of the predictor and free-run fits of the simulator.
        """
        runs = (predictor.one_step, simulator.free_run)
        rows = [
            nrmse_fit(y[self.washout :], run(u, y, self.washout)[self.washout :]) for run in runs
        ]
        return np.array(rows)

    @cached_property
    def nonparametric(self) -> LocalPolynomial:
        """Nonparametric response of the estimation part."""
        return local_polynomial(self.u[: self.estimation], self.y[: self.estimation])

    @property
    def problem_size(self) -> float:
        """Number of output samples that methods may use.

        There is no objective: the answer is two models, each made by a criterion of its own.
        """
        return float(self.estimation * self.y.shape[1])

    @property
    def held_out(self) -> str:
        """What a score quantifies over."""
        return f"for the last {len(self.u) - self.estimation} samples of this record"

    def checks(self, answer: IdentifiedModels, tolerance: float) -> list[Check]:
        rest = slice(self.estimation, None)
        missed = 1 - self._fits(answer, rest) / 100
        radii = [
            (name, matrix, radius)
            for name in MODELS
            for matrix, radius in (
                ("A", getattr(answer, name).radius),
                ("A - K C", getattr(answer, name).predictor_radius),
            )
        ]
        return [
            *(
                Check(f"stable {name}, {matrix}", "spectral radius", radius, 1.0, over=THIS_SYSTEM)
                for name, matrix, radius in radii
            ),
            *(
                Check(
                    use.replace("_", " "),
                    "error on the samples held out, over that of the mean",
                    float(np.max(row)),
                    1.0,
                    f"of y{int(np.argmax(row)) + 1}",
                    over=self.held_out,
                )
                for use, row in zip(USES, missed, strict=True)
            ),
        ]

    def second_opinion(self, answer: IdentifiedModels) -> list[Check]:
        rest = slice(self.estimation, None)
        m, u, y = answer.simulator, self.u[rest], self.y[rest]
        drive, measured = u - m.u_offset, y - m.y_offset
        run = convolved((m.A, m.B, m.C, m.D), drive, measured, self.washout)
        again = nrmse_fit(y[self.washout :], (run + m.y_offset)[self.washout :])
        apart = np.abs(again - self._fits(answer, rest)[1]) / 100
        name, statement = "convolution", "error by convolution less that by simulation"
        return [
            Check(name, statement, float(apart.max()), CONVOLUTION_ROUNDING, over=self.held_out),
            *(decays(getattr(answer, use).system(), f"{use} decays") for use in MODELS),
        ]

    def metrics(self, answer: IdentifiedModels) -> dict[str, float]:
        parts = {"": slice(self.estimation, None), "estimation_": slice(None, self.estimation)}
        numbers: dict[str, float] = {}
        for part, used in parts.items():
            for use, row in zip(USES, self._fits(answer, used), strict=True):
                numbers |= {f"{part}fit_{use}_y{i + 1}": float(v) for i, v in enumerate(row)}
        own, crossed = self.residual_tests(answer.predictor)
        return numbers | {
            "order": float(answer.predictor.order),
            "order_free_run": float(answer.simulator.order),
            "residual_autocorrelations_outside": share_outside(own),
            "residual_input_correlations_outside": share_outside(crossed[RESIDUAL_LAGS:]),
        }

    def _fits(self, answer: IdentifiedModels, part: slice) -> RealArray:
        """Fits (uses, ny) [%] of the answer on a part of the record."""
        return self.fits(answer.predictor, answer.simulator, self.u[part], self.y[part])

    def residual_tests(self, model: InnovationsModel) -> tuple[RealArray, RealArray]:
        """`autocorrelation` and `cross_correlation` of one-step errors on the held-out samples."""
        u, y = self.u[self.estimation :], self.y[self.estimation :]
        errors = (y - model.one_step(u, y, self.washout))[self.washout :]
        return autocorrelation(errors, RESIDUAL_LAGS), cross_correlation(
            errors, u[self.washout :], RESIDUAL_LAGS
        )

    def tables(self, answer: IdentifiedModels) -> dict[str, str]:
        outputs = [f"y{i + 1}" for i in range(self.y.shape[1])]
        fits = [f"{use.replace('_', ' ')} {of} [%]" for use in USES for of in (*outputs, "mean")]
        rows = [
            [order, *(f"{x:.2f}" for row in score for x in (*row, row.mean()))]
            for order, score in zip(self.orders, answer.scores.swapaxes(0, 1), strict=True)
        ]
        return {"validation": markdown(["order", *fits], rows)}

    def figures(self, answer: IdentifiedModels) -> dict[str, Figure]:
        data = self.to_dataset(answer)
        return {
            "held-out": drawn.held_out_figure(data, self.title),
            "response": drawn.two_responses_figure(data, self.title),
            "residuals": drawn.residuals_figure(data),
            "validation": drawn.validation_figure(data),
        }

    def to_dataset(self, answer: IdentifiedModels) -> Dataset:
        import xarray as xr

        predictor, simulator = answer.predictor, answer.simulator
        estimate = self.nonparametric
        u, y = self.u[self.estimation :], self.y[self.estimation :]
        grid = ("frequency", "output", "input")
        own, crossed = self.residual_tests(predictor)
        held = ("time", "output")
        return xr.Dataset(
            {
                **{
                    f"{name}_{matrix}": (
                        tuple(dim.format(name) for dim in dims),
                        getattr(getattr(answer, name), matrix),
                    )
                    for name in MODELS
                    for matrix, dims in MATRICES.items()
                },
                "validation_fit": (("use", "order", "output"), answer.scores, {"units": "%"}),
                "measured": (held, y, {"long_name": "held-out record"}),
                "one_step": (held, predictor.one_step(u, y, self.washout)),
                "free_run": (held, simulator.free_run(u, y, self.washout)),
                "response": (
                    grid,
                    simulator.response(estimate.frequency),
                    {"long_name": "of the simulator"},
                ),
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
                "use": list(USES),
                "time": ("time", np.arange(self.estimation, len(self.u)), {"units": "samples"}),
                "frequency": ("frequency", estimate.frequency, {"units": "cycles/sample"}),
                "lag": ("lag", np.arange(1, RESIDUAL_LAGS + 1), {"units": "samples"}),
                "shift": (
                    "shift",
                    np.arange(-RESIDUAL_LAGS, RESIDUAL_LAGS + 1),
                    {"units": "samples"},
                ),
            },
            attrs={"washout": self.washout},
        )

    def from_dataset(self, data: Dataset) -> IdentifiedModels:
        predictor, simulator = (
            InnovationsModel(**{matrix: data[f"{name}_{matrix}"].values for matrix in MATRICES})
            for name in MODELS
        )
        scores = data["validation_fit"].values
        return IdentifiedModels(predictor, simulator, scores, self.sample_time)
