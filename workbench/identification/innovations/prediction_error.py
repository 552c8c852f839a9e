"""Prediction-error refinement of innovations models by Levenberg-Marquardt iterations.

Source: L. Ljung, System Identification, 2nd ed., 1999, sections 10.2 and 15.2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench.arrays import BoolArray
from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.criterion import Criterion
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.scaling import Scaling

MIN_LIKELIHOOD_GAIN = 1.0
"""Gain in log likelihood below which an iteration is the last: Akaike's penalty for one parameter.

Iterations that gain less fit the noise of this record.
"""
CIRCLE_ROUNDING = 1e-10
"""Distance of a predictor's poles from the unit circle that eigenvalues are computed to."""


def refinable(model: InnovationsModel, largest_radius: float = 1.0) -> bool:
    """Whether `refine` can start from a model: its poles and its predictor's are where they may."""
    poles_allowed = model.radius <= largest_radius + CIRCLE_ROUNDING
    return poles_allowed and model.predictor_radius < 1 - CIRCLE_ROUNDING


def refine(
    model: InnovationsModel,
    record: Experiments,
    simulation_weight: float = 0.1,
    iterations: int = 100,
    *,
    direct: bool = True,
    largest_radius: float = 1.0,
    entries: BoolArray | None = None,
) -> tuple[InnovationsModel, int]:
    """Refine a model on experiments by Levenberg-Marquardt iterations.

    All entries of A, B, C, D, K, the offsets and the initial states are free. Directions that only
    change the basis of the state have no effect on the criterion, and the damping keeps them
    unchanged. Steps are refused if they make the predictor unstable or bring a pole of the model
    beyond the largest radius.

    Parameters
    ----------
    simulation_weight
        Weight of the errors in free run. Models whose free run grows have none.
    direct
        Whether inputs may act at once, through D.
    largest_radius
        Largest modulus of a pole of the model; infinite where the plant may be unstable.
    entries
        Which entries of A, B, C, D and K are free, as for `Criterion`; the others stay.

    Returns
    -------
    The refined model and the number of iterations.

    Raises
    ------
    InputError
        The starting model has a pole beyond the largest radius, or its predictor is unstable.
    """
    slowest = 1 - CIRCLE_ROUNDING
    if not refinable(model, largest_radius):
        raise InputError("the model to start from or its predictor is unstable; lower the order")
    scaling = Scaling.of(record)
    pieces = [scaling.scaled(*piece) for piece in record.pieces()]
    unit = replace(record, u=np.vstack([u for u, _ in pieces]), y=np.vstack([y for _, y in pieces]))
    start = scaling.applied(model)
    if start.radius > 1 + 1 / len(record):
        simulation_weight = 0.0
    criterion = Criterion(start, unit, simulation_weight, direct, entries)
    theta = criterion.start(start)
    value, gradient, hessian = criterion.expand(theta)
    damping, done = 1e-2, 0
    while done < iterations and np.isfinite(value):
        # Scale to a unit diagonal, so that the step does not depend on the units of the signals.
        scale = np.sqrt(np.diag(hessian))
        scale[scale == 0] = 1.0
        normed = hessian / np.outer(scale, scale)
        decrease = 0.0
        while damping < 1e10:
            damped = normed + (damping + 1e-9) * np.eye(len(normed))
            trial = theta - np.linalg.solve(damped, gradient / scale) / scale
            candidate = criterion.model(trial)
            if candidate.predictor_radius < slowest and candidate.radius <= largest_radius:
                decrease = value - criterion(trial)
                if decrease > 0:
                    break
            damping *= 4
        if decrease <= 0:
            break
        theta, damping, done = trial, max(damping / 5, 1e-8), done + 1
        if decrease < MIN_LIKELIHOOD_GAIN:
            break
        value, gradient, hessian = criterion.expand(theta)
    return (scaling.restored(criterion.model(theta), record) if done else model), done
