"""Methods "best" and "averaged": models of all kinds and orders are validated for each use.

The choice sees the estimation part only, and holds back each of its folds in turn; the held-out
samples judge the result once. Blocks of the errors show how much of a difference is chance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.identification.choice.averages import averaged_predictor, averaged_simulator
from workbench.identification.choice.levels import errors_beside_level, level_following
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.polynomials.methods import (
    arx_fits,
    impulse_response_fits,
    refusal,
    regularised_arx_fits,
    sparse_arx_fits,
    structured_fits,
)
from workbench.identification.polynomials.structures import PolynomialKind
from workbench.identification.state_space.candidates import (
    MEMBER_LOSS,
    PHYSICS,
    Candidates,
    block_means,
    compared_candidates,
    judged_variance,
    validation_errors,
)
from workbench.identification.state_space.control_weight import weighted_runs
from workbench.identification.state_space.folds import final_prediction_factor
from workbench.identification.state_space.identified import USES, IdentifiedModels
from workbench.identification.state_space.methods import SubspaceStarts, refined_fits
from workbench.identification.state_space.moesp import projection_fits
from workbench.identification.state_space.physical import PhysicalModel
from workbench.identification.state_space.program import StateSpaceFit
from workbench.identification.state_space.question import Fitter
from workbench.program import Claim, method
from workbench.solvers import Outcome

NO_MODEL = "no kind of model gives one whose errors are finite"
MOST_TRIED = 100_000
"""Most samples, counted from the first, that are divided into folds to compare the candidates.

There are ten times as many candidates as in a single method, with up to ten times as many states.
"""
LONG_ORDERS = (12, 20, 30)
"""Further orders of ARX models; long ones are cheap, and their errors are the whitest."""
SPARSE_LAGS = (4, 8, 12, 20, 30)
"""Longest lags of sparse ARX models."""


@method(StateSpaceFit, "best", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _best(program: StateSpaceFit, context: Context) -> Claim:
    """Validate all kinds of models and orders, and return the best one for each use."""
    trial = _Trial(program, context)
    if trial.candidates is None:
        return None, Outcome.FAILED, NO_MODEL
    return trial.claim([trial.kept(use, 1) for use in range(2)], trial.candidates)


@method(StateSpaceFit, "averaged", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _averaged(program: StateSpaceFit, context: Context) -> Claim:
    """The average of the models of all kinds and orders that validate best, for each use.

    Which single model is best is largely chance; the average errs less than most of them. Its
    predictions follow the level of their errors.
    """
    trial = _Trial(program, context)
    if trial.candidates is None:
        return None, Outcome.FAILED, NO_MODEL
    predictors, simulators = (trial.members(use) for use in range(2))
    if not (predictors and simulators):
        return None, Outcome.FAILED, NO_MODEL
    if program.known is None:
        predictors = [level_following(model) for model in predictors]
    predictor = averaged_predictor(predictors, program.largest_radius, program.holds_known)
    simulator = averaged_simulator(
        simulators, program.estimation_record, program.direct, program.largest_radius
    )
    if not program.holds_known(simulator):
        simulator = simulators[0]
    fits = np.array([trial.fit_of_average(use) for use in range(2)])
    return trial.claim([[predictor], [simulator]], replace(trial.candidates, averaged=fits))


class _Trial:
    """The candidates of a program; each is validated once."""

    def __init__(self, program: StateSpaceFit, context: Context) -> None:
        self._program = program
        self._held_back = program.folds_within(MOST_TRIED)
        self._folds = self._held_back or [(program.estimation_record, program.estimation_record)]
        self._spreads = np.array(
            [judged_variance(left, program.washout_samples) for _, left in self._folds]
        )
        self._ways = dict(kinds_and_orders(program))
        self._errors: list[list[RealArray]] = []
        self._models: dict[int, InnovationsModel | None] = {}
        means = []
        for fit in context.track(list(self._ways.values()), "candidates"):
            found = [self._validated(fit, *fold) for fold in self._folds]
            self._errors.append(found)
            means.append([block_means(one) for one in found])
        made = compared_candidates(tuple(self._ways), np.array(means), self._spreads)
        self.candidates = made if np.isfinite(made.fits).any(axis=1).all() else None

    def _validated(self, fit: Fitter, used: Experiments, left: Experiments) -> RealArray:
        """Validation errors (uses, N, ny) of a fitting function; infinite if it gives no model.

        Without folds, the errors have the size that Akaike's final prediction error expects.
        """
        program = self._program
        model = fit(used)
        if model is None:
            judged = sum(max(len(u) - program.washout_samples, 0) for u, _ in left.pieces())
            return np.full((2, judged, left.y.shape[1]), np.inf)
        errors = validation_errors(model, left, program.washout_samples)
        if program.bandwidth_hz is not None:
            outputs, felt = weighted_runs(
                model, left, program.washout_samples, program.bandwidth_hz
            )
            size = np.sqrt(
                (outputs**2).mean(axis=0) / judged_variance(left, program.washout_samples)
            )
            errors[1] = felt / np.maximum(size, np.finfo(float).tiny)
        if not self._held_back:
            count = model.order * (2 * len(model.C) + model.B.shape[1])
            errors *= final_prediction_factor(count, len(used))
        return errors

    def members(self, use: int) -> list[InnovationsModel]:
        """Models of the whole estimation part to be averaged, best first.

        A candidate that validated well may fail on the whole part: a model that fits its own part
        far worse than the others do is dropped.
        """
        found = self.kept(use, len(self.candidates.members(use)) if self.candidates else 0)
        with np.errstate(all="ignore"):  # simulations may overflow
            own = [
                self._program.fits_to_choose_by(m, self._program.estimation_record)[use]
                for m in found
            ]
        fits = np.nan_to_num([fit.mean() for fit in own], nan=-np.inf)
        least = np.median(fits) - MEMBER_LOSS if found else 0.0
        return [model for model, fit in zip(found, fits, strict=True) if fit >= least]

    def kept(self, use: int, number: int) -> list[InnovationsModel]:
        """Models of the whole estimation part, by the fitting functions that validated best."""
        found: list[InnovationsModel] = []
        if self.candidates is None:
            return found
        scores = self.candidates.fits[use].copy()
        scores[self.candidates.best(use)] = np.inf
        for place in map(int, np.argsort(-scores, kind="stable")):
            model = self._model(place) if scores[place] > -np.inf else None
            found += [] if model is None else [model]
            if len(found) == number:
                break
        return found

    def _model(self, place: int) -> InnovationsModel | None:
        """A candidate's model of the whole estimation part; it is computed once."""
        if place not in self._models:
            self._models[place] = list(self._ways.values())[place](self._program.estimation_record)
        return self._models[place]

    def fit_of_average(self, use: int) -> float:
        """Fit [%] of the average of the best candidates, as a mean over outputs and folds."""
        members = self.candidates.members(use) if self.candidates else []
        relative = []
        for fold, spread in enumerate(self._spreads):
            errors = np.mean([self._errors[k][fold][use] for k in members], axis=0)
            left = errors_beside_level(errors) if USES[use] == "one_step" else errors
            relative.append((left**2).mean(axis=0) / spread)
        return float(100 * (1 - np.sqrt(relative).mean()))

    def claim(self, chosen: list[list[InnovationsModel]], candidates: Candidates) -> Claim:
        """The answer: the first of the models chosen for each use."""
        if not all(chosen):
            return None, Outcome.FAILED, NO_MODEL
        predictor, simulator = (models[0] for models in chosen)
        answer = IdentifiedModels(
            predictor,
            simulator,
            _by_order(self._program, candidates),
            self._program.record.dt,
            candidates=candidates,
        )
        said = "; ".join(candidates.words(k, task) for k, task in enumerate(self._program.tasks))
        return answer, Outcome.SOLVED, said


def kinds_and_orders(program: StateSpaceFit) -> Iterator[tuple[str, Fitter]]:
    """Label and fitting function of every candidate."""
    starts = SubspaceStarts(program)
    orders = tuple(program.orders or ())
    ways = {
        "state space (one-step errors)": refined_fits(program, starts, 0.0),
        "state space (both errors)": refined_fits(program, starts, 1.0),
        "CVA": projection_fits(program, "cva"),
        "N4SID": projection_fits(program, "n4sid"),
    }
    kinds: dict[str, PolynomialKind] = {
        "ARMAX": "armax", "output error": "output-error", "Box-Jenkins": "box-jenkins",
    }  # fmt: skip
    for label, polynomial in kinds.items():
        if refusal(program, polynomial) is None:
            ways[label] = structured_fits(program, polynomial, starts)
    for kind, way in ways.items():
        for order in orders:
            yield f"{kind} {order}", way(order)
    for name, physical in program.physical.items():
        states = physical.states(program.record)
        yield f"{name} {PHYSICS} {states}", _physical_fits(program, physical)
    several = program.record.y.shape[1] > 1
    for order in sorted({*orders, *LONG_ORDERS}):
        if program.determines_arx(order):
            yield f"ARX {order}", arx_fits(program)(order)
            if several and program.known is None:
                yield f"ARX of each output {order}", arx_fits(program, apart=True)(order)
    # sparse models and long regularised responses do not keep prior knowledge
    if program.known is not None:
        return
    for lags in SPARSE_LAGS:
        yield f"sparse ARX {lags}", sparse_arx_fits(program)(lags)
        if several:
            yield f"sparse ARX of each output {lags}", sparse_arx_fits(program, apart=True)(lags)
    yield "regularised ARX 1", regularised_arx_fits(program)(1)
    yield "impulse response 1", impulse_response_fits(program)(1)


def _physical_fits(program: StateSpaceFit, physical: PhysicalModel) -> Fitter:
    """Fitting function of a model from physics; it returns None if prior knowledge is violated."""

    def fit(record: Experiments) -> InnovationsModel | None:
        found = physical.fitted(
            record,
            delay_samples=program.delays_samples,
            direct=program.direct,
            largest_radius=program.largest_radius,
        )
        return found if found is not None and program.holds_known(found) else None

    return fit


def _by_order(program: StateSpaceFit, candidates: Candidates) -> RealArray:
    """Fits (uses, orders, ny) [%] of the best kind for each order, one kind for all outputs."""
    orders, outputs = tuple(program.orders or ()), program.record.y.shape[1]
    found = np.full((2, len(orders), outputs), -np.inf)
    for k, label in enumerate(candidates.labels):
        order = int(label.rpartition(" ")[2])
        if order in orders:
            place = orders.index(order)
            found[:, place] = np.maximum(found[:, place], candidates.fits[:, k, None])
    return found
