"""Methods for state-space models: subspace identification, and prediction errors minimised."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.identification.state_space.innovations import InnovationsModel
from workbench.identification.state_space.prediction_error import refine
from workbench.identification.state_space.program import Fitter, IdentifiedModels, StateSpaceFit
from workbench.identification.state_space.subspace import best_subspace
from workbench.program import Claim, method
from workbench.solvers import Outcome

SIMULATION_WEIGHTS = (0.0, 1.0)
"""Weights of free-run errors in the prediction-error method, for predictor and simulator.

The predictor is the maximum-likelihood estimate; the simulator weights both kinds of errors.
"""
FitterOfOrder = Callable[[int], Fitter]
"""Function of an order that gives a function to fit models of that order."""


def identify(
    program: StateSpaceFit, predictors: FitterOfOrder, simulators: FitterOfOrder, context: Context
) -> IdentifiedModels | None:
    """Models of the orders that validate best, one for each use, or None.

    Every order is validated; for each use the order with the best mean fit is then fitted to
    the whole estimation part. The result is None if no order gives a stable model.
    """
    ways = (predictors, simulators)
    tried = [(way, order) for way in dict.fromkeys(ways) for order in program.orders]
    fits = {
        (way, order): program.validate(way(order))
        for way, order in context.track(tried, "validation")
    }
    scores = np.array(
        [[fits[way, order][use] for order in program.orders] for use, way in enumerate(ways)]
    )
    predictor, simulator = (
        _best(program, way, means) for way, means in zip(ways, scores.mean(axis=-1), strict=True)
    )
    if predictor is None or simulator is None:
        return None
    return IdentifiedModels(predictor, simulator, scores, program.sample_time)


def _best(program: StateSpaceFit, way: FitterOfOrder, means: RealArray) -> InnovationsModel | None:
    """Stable model of the whole estimation part, of the order that validated best.

    If there is none, the next best order is taken; ``means`` are the orders' mean fits.
    """
    used = slice(None, program.estimation)
    for place in np.argsort(-means, kind="stable"):
        if np.isfinite(means[place]):
            model = way(program.orders[place])(program.u[used], program.y[used])
            if model is not None:
                return model
    return None


def claim(answer: IdentifiedModels | None) -> Claim:
    """Answer, outcome and message of a method."""
    if answer is None:
        return None, Outcome.FAILED, "no order gives a stable model with a stable predictor"
    orders = f"order {answer.predictor.order} to predict, {answer.simulator.order} to simulate"
    return answer, Outcome.SOLVED, orders


@method(StateSpaceFit, "subspace", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _subspace(program: StateSpaceFit, context: Context) -> Claim:
    """Predictor-based subspace identification for both uses; no iterations."""

    def way(order: int) -> Fitter:
        return lambda u, y: best_subspace(u, y, order)

    return claim(identify(program, way, way, context))


@method(StateSpaceFit, "prediction-error", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _prediction_error(program: StateSpaceFit, context: Context) -> Claim:
    """Minimisation of the errors of each use, from the subspace model, with exact gradients."""
    predictors, simulators = (_refined(weight) for weight in SIMULATION_WEIGHTS)
    return claim(identify(program, predictors, simulators, context))


def _refined(simulation_weight: float) -> FitterOfOrder:
    """Fitting functions by subspace identification and prediction-error refinement."""

    def way(order: int) -> Fitter:
        def fit(u: RealArray, y: RealArray) -> InnovationsModel | None:
            start = best_subspace(u, y, order)
            return start and refine(start, u, y, simulation_weight)[0]

        return fit

    return way
