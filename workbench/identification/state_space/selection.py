"""The orders that a record allows, and the choice of the model that fits it best."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.constrained import regressed, with_known_gains
from workbench.identification.innovations.gains import innovation_gain, inside_circle, with_inputs
from workbench.identification.innovations.knowledge import Knowledge
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.scaling import Scaling

HORIZONS = (10, 15, 20, 30, 40)
"""Lengths [samples] of the past that `best_subspace` tries."""
SHORT_HORIZONS = (2, 3, 4, 6)
"""Lengths [samples] of the past for records that are too short for the others."""


def fitting_pasts(order: int, samples: int, nu: int, ny: int) -> tuple[int, ...]:
    """The lengths of the past that a record of this length allows for an order."""
    for pasts in (HORIZONS, SHORT_HORIZONS):
        found = tuple(past for past in pasts if order_fits(order, past, samples, nu, ny))
        if found:
            return found
    return ()


def largest_order(samples: int, nu: int, ny: int) -> int:
    """Largest order that a record of this length allows; 0 if it is too short for any."""
    fitting = [p for p in (*HORIZONS, *SHORT_HORIZONS) if order_fits(1, p, samples, nu, ny)]
    return max(fitting, default=0) * ny


def order_fits(order: int, past: int, samples: int, nu: int, ny: int) -> bool:
    """Whether a record is long enough for the vector autoregression, and that for the order."""
    unknowns = past * (nu + ny) + nu
    return 1 <= order <= past * ny and samples - past >= 2 * unknowns


def refuse_order(order: int, past: int, samples: int, nu: int, ny: int) -> None:
    """Raise InputError unless `order_fits`."""
    if not order_fits(order, past, samples, nu, ny):
        raise InputError(
            f"order {order} with a past of {past} does not fit a record of {samples} samples: "
            f"1 <= order <= {past * ny} and at least {past + 2 * (past * (nu + ny) + nu)} samples "
            "are needed; lower the order, or the past, or take a longer record"
        )


def best_fitting(
    models: Iterable[InnovationsModel | None],
    record: Experiments,
    *,
    direct: bool = True,
    largest_radius: float = 1.0,
    known: Knowledge | None = None,
) -> InnovationsModel | None:
    """The model that fits experiments best; None if there is none.

    Poles outside the largest radius are reflected into it, and B and D are then estimated again.
    Known poles and gains are imposed.
    """
    usable = (
        each
        for model in models
        if model is not None
        for each in allowed_models(model, record, direct, largest_radius, known)
    )
    return least_of(usable, lambda model: misfit(model, record))


def least_of(
    models: Iterable[InnovationsModel | None], misfit: Callable[[InnovationsModel], float]
) -> InnovationsModel | None:
    """The model with the least finite misfit; None if there is none."""
    best, least = None, np.inf
    for model in models:
        if model is not None and (size := misfit(model)) < least:
            best, least = model, size
    return best


def allowed_models(
    model: InnovationsModel,
    record: Experiments,
    direct: bool,
    largest_radius: float,
    known: Knowledge | None,
) -> Iterator[InnovationsModel]:
    """The model as by `allowed`, or models near it that have the known poles and gains."""
    if known is None:
        found = allowed(model, record, direct, largest_radius)
        if found is not None:
            yield found
        return
    if not _predicts(model):
        settled = allowed(model, record, direct, largest_radius)
        if settled is None:
            return
        model = settled
    scaling = Scaling.of(record)
    size = scaling.y_spread[:, None] / scaling.u_spread
    ways = [False, True] if any(times > 1 for _, times in known.groups()) else [False]
    for parallel in ways:
        near = regressed(model, record, known, direct, parallel)
        usable = near and allowed(near, record, direct, largest_radius)
        exact = usable and known.exact(usable)
        if exact is None:
            continue
        simulated = exact.radius <= 1 + 1 / len(record)
        for predicting in (True, False) if simulated else (True,):
            found = with_known_gains(exact, record, known, direct, predicting)
            if found is not None and known.holds(found, size):
                yield found


def allowed(
    model: InnovationsModel, record: Experiments, direct: bool, largest_radius: float
) -> InnovationsModel | None:
    """The model with poles within the largest radius and a stable predictor, or None."""
    if model.radius >= largest_radius and not np.isclose(model.radius, largest_radius, atol=1e-12):
        A = inside_circle(model.A, min(largest_radius, 1 - 1e-9))
        moved = with_inputs(replace(model, A=A), list(record.pieces()), direct)
        if moved is None:
            return None
        model = moved
    if not _predicts(model):
        n, ny = model.order, len(model.C)
        gain = innovation_gain(model.A, model.C, np.zeros((n + ny, n + ny)))
        if gain is None:
            return None
        model = replace(model, K=gain)
    return model


def _predicts(model: InnovationsModel) -> bool:
    """Whether the predictor of a model is stable."""
    return bool(np.isfinite(model.K).all()) and model.predictor_radius < 1


def misfit(model: InnovationsModel, record: Experiments) -> float:
    """Sum of the relative errors of one-step predictions and, if stable, of free runs."""
    spread = np.nanstd(record.y, axis=0)
    simulated = model.radius <= 1 + 1 / len(record)
    runs = (model.one_step, model.free_run) if simulated else (model.one_step,)
    total = 0.0
    for run in runs:
        squares = sum(np.nansum((y - run(u, y, len(y))) ** 2, axis=0) for u, y in record.pieces())
        total += float(np.mean(np.sqrt(squares / len(record)) / spread))
    return total if np.isfinite(total) else np.inf
