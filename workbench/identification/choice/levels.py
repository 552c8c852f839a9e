"""Predictors that follow the level of their errors, slowly.

An operating point that moves leaves a constant error that no white noise explains, and no part of
the record on which a model is validated need show it. A level that is learnt from past errors over
some fifty samples removes it. Where errors are white it costs little: half the rate of their
variance. Source: G. Box, G. Jenkins, Time Series Analysis, 1970, section 5.3 (the exponentially
weighted mean as the predictor of integrated noise).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag
from scipy.signal import lfilter

from workbench._core.arrays import RealArray
from workbench.identification.innovations.model import InnovationsModel

LEVEL_RATE = 0.02
"""Share of an error that goes into the level: a step is followed within some fifty samples."""
LEVEL_POLE = 1 - 0.01 * LEVEL_RATE
"""Pole of the level, inside the circle: a hundredth of a step is never followed."""


def level_following(model: InnovationsModel) -> InnovationsModel:
    """The model whose predictions have the level of its past errors added.

    Predictions of the model are left as they are, and an output's level d is added to them:

        d(t+1) = LEVEL_POLE d + LEVEL_RATE (y - yhat - d)

    It has a state more for each output, which starts at zero; responses stay the same.
    """
    ny = len(model.C)
    one = np.eye(ny)
    A = block_diag(model.A, LEVEL_POLE * one)
    # The predictor of the model is driven by its own error, which is the new one and the level.
    A[: model.order, model.order :] = model.K
    return replace(
        model,
        A=A,
        B=np.vstack([model.B, np.zeros((ny, model.B.shape[1]))]),
        C=np.hstack([model.C, one]),
        K=np.vstack([model.K, LEVEL_RATE * one]),
        resting=model.resting + ny,
    )


def errors_beside_level(errors: RealArray) -> RealArray:
    """Errors (N, ny) of predictions that have the level of their past errors added, from zero."""
    found = lfilter([1.0, -LEVEL_POLE], [1.0, LEVEL_RATE - LEVEL_POLE], errors, axis=0)
    return np.asarray(found)
