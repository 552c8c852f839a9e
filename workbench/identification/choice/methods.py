"""Method "best": every kind and order is validated; the best to predict and to simulate are kept.

The choice sees the estimation part alone, whose folds are held back in turn; the samples held out
judge it once. How much of a difference is chance is estimated from blocks of the errors.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.polynomials.methods import (
    arx_fits,
    impulse_response_fits,
    structured_fits,
)
from workbench.identification.state_space.candidates import (
    BLOCKS,
    Candidates,
    block_errors,
    compared_candidates,
)
from workbench.identification.state_space.folds import final_prediction_factor
from workbench.identification.state_space.identified import IdentifiedModels
from workbench.identification.state_space.methods import SubspaceStarts, refined_fits
from workbench.identification.state_space.moesp import projection_fits
from workbench.identification.state_space.program import StateSpaceFit
from workbench.identification.state_space.question import Fitter
from workbench.program import Claim, method
from workbench.solvers import Outcome

LONG_ORDERS = (12, 20)
"""Further orders of ARX models, which are cheap and whitest where they are long."""


@method(StateSpaceFit, "best", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _best(program: StateSpaceFit, context: Context) -> Claim:
    """All kinds of models and orders in validation, and the best one for each use."""
    ways = dict(kinds_and_orders(program))
    errors, spreads = [], None
    for fit in context.track(list(ways.values()), "candidates"):
        one, spreads = _validated(program, fit)
        errors.append(one)
    if spreads is None:
        return None, Outcome.FAILED, "no kind of model was tried"
    candidates = compared_candidates(tuple(ways), np.array(errors), spreads)
    fits = list(ways.values())
    chosen = [_kept(program, fits, candidates.fits[use]) for use in range(2)]
    predictor, simulator = chosen
    if predictor is None or simulator is None:
        return None, Outcome.FAILED, "no kind of model gives one whose errors are finite"
    scores = _by_order(program, candidates)
    answer = IdentifiedModels(
        predictor, simulator, scores, program.record.sample_time, candidates=candidates
    )
    said = "; ".join(
        candidates.words(use, task) for use, task in enumerate(("predict", "simulate"))
    )
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
        "ARMAX": structured_fits(program, "armax", starts),
        "output error": structured_fits(program, "output-error", starts),
        "Box-Jenkins": structured_fits(program, "box-jenkins", starts),
    }
    for kind, way in ways.items():
        for order in orders:
            yield f"{kind} {order}", way(order)
    for order in (*orders, *LONG_ORDERS):
        if program.determines_arx(order):
            yield f"ARX {order}", arx_fits(program)(order)
    yield "impulse response 1", impulse_response_fits(program)(1)


def _validated(program: StateSpaceFit, fit: Fitter) -> tuple[RealArray, RealArray]:
    """Square errors (folds, uses, blocks, ny) and variances of outputs (folds, ny) in validation.

    Without folds they are what Akaike's final prediction error expects.
    """
    ny = program.record.y.shape[1]
    folds = program.folds or [(program.used, program.used)]
    errors, spreads = np.full((len(folds), 2, BLOCKS, ny), np.inf), np.ones((len(folds), ny))
    for number, (used, left) in enumerate(folds):
        model = fit(used)
        if model is not None:
            errors[number], spreads[number] = block_errors(model, left, program.washed)
            if not program.folds:
                count = model.order * (2 * ny + model.B.shape[1])
                errors[number] *= final_prediction_factor(count, len(used)) ** 2
    return errors, spreads


def _kept(program: StateSpaceFit, fits: list[Fitter], scores: RealArray) -> InnovationsModel | None:
    """Model of the whole estimation part by the fitting function that validated best."""
    for place in np.argsort(-scores, kind="stable"):
        if np.isfinite(scores[place]):
            model = fits[place](program.used)
            if model is not None:
                return model
    return None


def _by_order(program: StateSpaceFit, candidates: Candidates) -> RealArray:
    """Fits (uses, orders, ny) [%] of the best kind of each order, the same for all outputs."""
    orders, outputs = tuple(program.orders or ()), program.record.y.shape[1]
    found = np.full((2, len(orders), outputs), -np.inf)
    for k, label in enumerate(candidates.labels):
        order = int(label.rpartition(" ")[2])
        if order in orders:
            place = orders.index(order)
            found[:, place] = np.maximum(found[:, place], candidates.fits[:, k, None])
    return found
