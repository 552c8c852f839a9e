"""Averages of models: one model that gives the mean of several models' predictions or simulations.

If many models validate alike, the choice of one is largely chance. The mean of their outputs has
their mean bias, and less variance. Source: L. Breiman, "Stacked regressions", Machine Learning
24(1), 1996. The weights are equal: weights fitted to validation errors judge worse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.gains import operating_point
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.state_space.selection import allowed


def averaged_predictor(
    models: Sequence[InnovationsModel],
    largest_radius: float = 1.0,
    holds: Callable[[InnovationsModel], bool] = lambda _: True,
) -> InnovationsModel:
    """The model whose one-step predictions are the mean of several models' predictions.

    ``models`` come best first. The average may have a pole beyond the largest radius although no
    member has one. Then members are dropped from the end until it has none, and until it ``holds``
    the prior knowledge.

    Raises InputError if there is no model, or if the delays differ.
    """
    _refuse(models)
    for count in range(len(models), 1, -1):
        mean = _mean(models[:count])
        if mean.radius <= largest_radius and mean.predictor_radius < 1 and holds(mean):
            return replace(mean, members=tuple(models[:count]))
    return models[0]


def averaged_simulator(
    models: Sequence[InnovationsModel],
    record: Experiments,
    direct: bool = True,
    largest_radius: float = 1.0,
) -> InnovationsModel:
    """The model whose simulations are the mean of several models' simulations.

    ``models`` come best first. The average is not made for prediction: its gain is zero if its
    poles are stable. If no gain gives a stable predictor, the best model alone is returned. Raises
    as `averaged_predictor`.
    """
    _refuse(models)
    mean = _mean([replace(model, K=np.zeros_like(model.K)) for model in models])
    found = allowed(mean, record, direct, largest_radius)
    return models[0] if found is None else replace(found, members=tuple(models))


def _refuse(models: Sequence[InnovationsModel]) -> None:
    """Raise `InputError` unless there are models with the same delays."""
    if not models:
        raise InputError("no model to average; give at least one")
    if len({model.delay_samples for model in models}) > 1:
        delays = ", ".join(str(model.delay_samples) for model in models)
        raise InputError(f"models with delays {delays} have no average; delays must be the same")


def _mean(models: Sequence[InnovationsModel]) -> InnovationsModel:
    """The innovations model whose predictor is the mean of the models' predictors.

    The predictors x+ = F x + G u + K y + f, yhat = C x + D u + h run in parallel.
    """
    share = 1 / len(models)
    F = block_diag(*[m.A - m.K @ m.C for m in models])
    G = np.vstack([m.B - m.K @ m.D for m in models])
    K = np.vstack([m.K for m in models])
    C = np.hstack([share * m.C for m in models])
    D = np.mean([m.D for m in models], axis=0)
    f = np.concatenate([-(m.B - m.K @ m.D) @ m.u_offset - m.K @ m.y_offset for m in models])
    h = np.mean([m.y_offset - m.D @ m.u_offset for m in models], axis=0)
    A, B = F + K @ C, G + K @ D
    u_offset, y_offset = operating_point(A, B, C, D, f + K @ h, h)
    joint = replace(models[0], A=A, B=B, C=C, D=D, K=K, u_offset=u_offset, y_offset=y_offset)
    return replace(joint, resting=0)
