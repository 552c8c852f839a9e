"""Prediction-error refinement of innovations models by Levenberg-Marquardt iterations.

Source: L. Ljung, System Identification, 2nd ed., 1999, sections 10.2 and 15.2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench._core.arrays import BoolArray
from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.criterion import Criterion
from workbench.identification.innovations.gain_surface import GainSurface
from workbench.identification.innovations.knowledge import Knowledge
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.pole_limits import CIRCLE_ROUNDING, PoleLimits
from workbench.identification.innovations.scaling import Scaling

MIN_LIKELIHOOD_GAIN = 1.0
"""The iteration ends when a step gains less than this in log likelihood: Akaike's penalty for one
parameter.

Further iterations would fit the noise of this record.
"""
COARSE_SAMPLES = 20_000
"""Leading samples of a longer record that the first iterations use, since they are cheap."""
LONG = 4
"""A record is long if it has at least so many times `COARSE_SAMPLES`."""
MOST_PRODUCTS = 2e11
"""Most products in one pass over the derivatives; models with many states use only as many samples
as this allows.
"""


def refinable(model: InnovationsModel, largest_radius: float = 1.0) -> bool:
    """Whether `refine` can start from a model: its poles and its predictor's are admissible."""
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
    known: Knowledge | None = None,
    least_gain: float = MIN_LIKELIHOOD_GAIN,
) -> tuple[InnovationsModel, int]:
    """Refine a model on experiments by Levenberg-Marquardt iterations.

    All entries of A, B, C, D, K, the offsets and the initial states are free. Directions that only
    change the basis of the state have no effect on the criterion, and the damping keeps them
    unchanged. Steps that make the predictor unstable, or bring a pole of the model beyond the
    largest radius, are projected onto these limits, and the search goes on along them.

    For a long record the iteration begins on its first `COARSE_SAMPLES`; the last iterations use
    all of it or, for a model with many states, as much as `MOST_PRODUCTS` allows, but at least the
    first part.

    Parameters
    ----------
    simulation_weight
        Weight of the free-run errors; zero for models whose free run is unstable.
    direct
        Whether inputs may act at once, through D.
    largest_radius
        Largest modulus of a pole of the model; infinite if the plant may be unstable.
    entries
        The free entries of A, B, C, D and K, as for `Criterion`; the others are fixed.
    known
        Gains to keep; each step stays on the surface of models with these gains. Known poles are
        kept by fixing entries.
    least_gain
        Gain in log likelihood below which an iteration is the last.

    Returns
    -------
    The refined model and the number of iterations.

    Raises
    ------
    InputError
        The starting model has a pole beyond the largest radius, or its predictor is unstable.
    """
    if not refinable(model, largest_radius):
        raise InputError("the model to start from or its predictor is unstable; lower the order")
    total = 0
    rest = (simulation_weight, iterations, direct, largest_radius, entries, known, least_gain)
    *begin, last = _stages(record, model)
    for part in begin:
        near, done = _refined(model, part, *rest)
        total += done

        def value(each: InnovationsModel) -> float:
            criterion = Criterion(each, last, simulation_weight, direct)
            return criterion(criterion.start(each))

        model = min(model, near, key=value)  # the start may have been fitted to the whole record
    model, done = _refined(model, last, *rest)
    return model, total + done


def _stages(record: Experiments, model: InnovationsModel) -> list[Experiments]:
    """Successive parts of a record on which a model is refined."""
    n, channels = model.order, record.u.shape[1] + record.y.shape[1]
    affordable = int(MOST_PRODUCTS / max(n * n * n * (n + channels), 1))
    whole = record.part(0, min(len(record), max(affordable, COARSE_SAMPLES)))
    if len(whole) == len(record):
        whole = record
    coarse = record.part(0, COARSE_SAMPLES)
    alike = all(part.still_inputs() == record.still_inputs() for part in (coarse, whole))
    if len(record) < LONG * COARSE_SAMPLES or not alike:
        return [record]
    return [coarse, whole] if len(whole) >= LONG * COARSE_SAMPLES else [whole]


def _refined(
    model: InnovationsModel,
    record: Experiments,
    simulation_weight: float,
    iterations: int,
    direct: bool,
    largest_radius: float,
    entries: BoolArray | None,
    known: Knowledge | None,
    least_gain: float,
) -> tuple[InnovationsModel, int]:
    """The refined model of one part of a record, and the number of iterations."""
    scaling = Scaling.of(record)
    pieces = [scaling.scaled(*piece) for piece in record.pieces()]
    unit = replace(record, u=np.vstack([u for u, _ in pieces]), y=np.vstack([y for _, y in pieces]))
    start = scaling.applied(model)
    if start.radius > 1 + 1 / len(record):
        simulation_weight = 0.0
    criterion = Criterion(start, unit, simulation_weight, direct, entries)
    limits, surface = PoleLimits(criterion, largest_radius), None
    if known is not None and known.gain is not None:
        surface = GainSurface(criterion, known.in_units(scaling.u_spread, scaling.y_spread))
    theta = criterion.start(start)
    if surface is not None:
        theta = surface.nearest(theta)
    value, gradient, hessian = criterion.expand(theta)
    damping, done = 1e-2, 0
    while done < iterations and np.isfinite(value):
        # Scale to a unit diagonal, so that the step does not depend on the units of the signals.
        scale = np.sqrt(np.diag(hessian))
        scale[scale == 0] = 1.0
        normed = hessian / np.outer(scale, scale)
        basis = None if surface is None else surface.tangent(theta, scale)
        if basis is not None:
            normed = basis.T @ normed @ basis
        decrease = 0.0
        while damping < 1e10:
            damped = normed + (damping + 1e-9) * np.eye(len(normed))
            inverse = np.linalg.inv(damped)
            if basis is not None:
                inverse = basis @ inverse @ basis.T
            covariance = inverse / np.outer(scale, scale)
            trial = limits.projected(theta - covariance @ gradient, covariance)
            if surface is not None:
                trial = surface.nearest(trial)
            if limits.hold(criterion.model(trial)):
                decrease = value - criterion(trial)
                if decrease > 0:
                    break
            damping *= 4
        if decrease <= 0:
            break
        theta, damping, done = trial, max(damping / 5, 1e-8), done + 1
        if decrease < least_gain:
            break
        value, gradient, hessian = criterion.expand(theta)
    moved = done or surface is not None
    return (scaling.restored(criterion.model(theta), record) if moved else model), done
