"""Methods for state-space models: subspace identification, and minimised prediction errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.criterion import Criterion
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.prediction_error import (
    COARSE_SAMPLES,
    MIN_LIKELIHOOD_GAIN,
    refinable,
    refine,
)
from workbench.identification.state_space.facts import whiteness_of
from workbench.identification.state_space.gaps import bridged
from workbench.identification.state_space.identified import IdentifiedModels
from workbench.identification.state_space.program import StateSpaceFit
from workbench.identification.state_space.question import Fitter
from workbench.identification.state_space.selection import (
    allowed_models,
    fitting_pasts,
    least_of,
    misfit,
)
from workbench.identification.state_space.subspace import SubspaceModels
from workbench.program import Claim, method
from workbench.solvers import Outcome

SIMULATION_WEIGHTS = (0.0, 1.0)
"""Weights of free-run errors in the prediction-error method, for predictor and simulator.

The predictor is the maximum-likelihood estimate; the simulator weights both kinds of errors.
"""
CONVERGED = 0.01
"""Gain in log likelihood of an iteration below which a search has converged."""
FitterOfOrder = Callable[[int], Fitter]
"""Function of an order; it returns a function that fits models of that order."""


def identify(
    program: StateSpaceFit, predictors: FitterOfOrder, simulators: FitterOfOrder, context: Context
) -> IdentifiedModels | None:
    """Models of the orders that validate best, one for each use, or None.

    Every order is validated; for each use the order with the best mean fit is then fitted to
    the whole estimation part. The result is None if no order gives a model.
    """
    ways, orders = (predictors, simulators), tuple(program.orders or ())
    tried = [(way, order) for way in dict.fromkeys(ways) for order in orders]
    fits = {
        (way, order): program.validate(way(order))
        for way, order in context.track(tried, "validation")
    }
    scores = np.array([[fits[way, order][use] for order in orders] for use, way in enumerate(ways)])
    means = scores.mean(axis=-1)
    if program.poles == "any":  # the free run of an unstable plant says nothing
        means = means[[0, 0]]
    fitted: dict[tuple[FitterOfOrder, int], InnovationsModel | None] = {}
    predictor, simulator = (
        _best(program, way, score, fitted) for way, score in zip(ways, means, strict=True)
    )
    if predictor is None or simulator is None:
        return None
    return IdentifiedModels(predictor, simulator, scores, program.record.dt)


def _best(
    program: StateSpaceFit,
    way: FitterOfOrder,
    means: RealArray,
    fitted: dict[tuple[FitterOfOrder, int], InnovationsModel | None],
) -> InnovationsModel | None:
    """Model of the whole estimation part, with the order that validated best.

    If there is none, the next best order is used; ``means`` are the orders' mean fits. Models
    already ``fitted`` for the other use are reused.
    """
    for place in np.argsort(-means, kind="stable"):
        if np.isfinite(means[place]):
            order = tuple(program.orders or ())[place]
            if (way, order) not in fitted:
                fitted[way, order] = way(order)(program.estimation_record)
            if fitted[way, order] is not None:
                return fitted[way, order]
    return None


def claim(answer: IdentifiedModels | None) -> Claim:
    """Answer, outcome and message of a method."""
    if answer is None:
        return None, Outcome.FAILED, "no order gives a model whose errors are finite"
    orders = f"order {answer.predictor.order} to predict, {answer.simulator.order} to simulate"
    return answer, Outcome.SOLVED, orders


class SubspaceStarts:
    """Subspace models of parts of a record, one for each past; each is computed once."""

    def __init__(self, program: StateSpaceFit) -> None:
        self._program = program
        self._regressions: dict[int, SubspaceModels] = {}
        self._found: dict[tuple[int, int], list[InnovationsModel]] = {}
        self._bridged: dict[int, Experiments] = {}

    def of(self, record: Experiments, order: int) -> list[InnovationsModel]:
        """Models of an order for a part that the program keeps; none if it is too short."""
        key = (id(record), order)
        if key not in self._found:
            self._found[key] = self._computed(record, order)
        return self._found[key]

    def _whole(self, record: Experiments) -> Experiments:
        """The record with its inputs delayed, and with gaps filled if they leave few rows."""
        if id(record) not in self._bridged:
            late = record.delayed(self._program.delays_samples)
            self._bridged[id(record)] = bridged(late, self._program.direct)
        return self._bridged[id(record)]

    def _computed(self, record: Experiments, order: int) -> list[InnovationsModel]:
        program = self._program
        nu, ny = record.u.shape[1], record.y.shape[1]
        late = self._whole(record)
        pasts = fitting_pasts(order, len(late), nu, ny)
        if pasts and id(record) not in self._regressions:
            orders = {order, *(program.orders or ())}
            every = {past for n in orders for past in fitting_pasts(n, len(late), nu, ny)}
            self._regressions[id(record)] = SubspaceModels(late, sorted(every), program.direct)
        found: list[InnovationsModel] = []
        for past in pasts:
            model = replace(
                self._regressions[id(record)].model(order, past),
                delay_samples=program.delays_samples,
            )
            found += allowed_models(
                model, record, program.direct, program.largest_radius, program.known
            )
        return found


@method(StateSpaceFit, "subspace", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _subspace(program: StateSpaceFit, context: Context) -> Claim:
    """Predictor-based subspace identification for both uses; no iterations."""
    starts = SubspaceStarts(program)

    def way(order: int) -> Fitter:
        return lambda record: least_of(
            starts.of(record, order), lambda model: misfit(model, record)
        )

    return claim(identify(program, way, way, context))


@method(StateSpaceFit, "prediction-error", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _prediction_error(program: StateSpaceFit, context: Context) -> Claim:
    """Minimisation of the errors of each use, from the subspace model, with exact gradients."""
    starts = SubspaceStarts(program)
    predictors, simulators = (
        refined_fits(program, starts, weight) for weight in SIMULATION_WEIGHTS
    )
    return claim(identify(program, predictors, simulators, context))


def refined_fits(
    program: StateSpaceFit,
    starts: SubspaceStarts,
    simulation_weight: float,
    tried: int = 1,
    least_gain: float = MIN_LIKELIHOOD_GAIN,
) -> FitterOfOrder:
    """Fitting functions that refine those subspace models with the least criterion.

    ``tried`` models are refined and the best is kept; the iterations end when one gains less than
    ``least_gain`` in log likelihood. If its errors are not white, the search may have stopped early
    or in a local minimum: it goes on until it has converged, and from the other models, one by one,
    until the errors of the best are white. For parts that are fitted to choose an order, one start
    and the usual limit are used.
    """

    def way(order: int) -> Fitter:
        def fit(record: Experiments) -> InnovationsModel | None:
            def value(model: InnovationsModel) -> float:
                criterion = Criterion(model, record, simulation_weight, program.direct)
                return criterion(criterion.start(model))

            known, whole = program.known, record is program.estimation_record

            def refined(start: InnovationsModel, gain: float) -> InnovationsModel:
                return refine(
                    start, record, simulation_weight,
                    direct=program.direct, largest_radius=program.largest_radius, known=known,
                    entries=None if known is None else known.free_entries(start), least_gain=gain,
                )[0]  # fmt: skip

            usable = [m for m in starts.of(record, order) if refinable(m, program.largest_radius)]
            usable.sort(key=value)
            if not whole:
                return least_of([refined(m, MIN_LIKELIHOOD_GAIN) for m in usable[:1]], value)
            best = least_of([refined(m, least_gain) for m in usable[:tried]], value)
            for start in (best, *usable[tried:]):
                if best is None or start is None or not _may_be_local(program, best):
                    break
                best = least_of([best, refined(start, CONVERGED)], value)
            return best

        return fit

    return way


def _may_be_local(program: StateSpaceFit, model: InnovationsModel | None) -> bool:
    """Whether a search from elsewhere may find a better model: one whose errors are white.

    No model of a long record is so good that its errors seem white.
    """
    if model is None or len(program.estimation_record) > COARSE_SAMPLES:
        return False
    white = whiteness_of(program, model)
    return white is not None and not white.holds
