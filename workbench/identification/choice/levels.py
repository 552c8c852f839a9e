"""Predictors that slowly follow a constant error.

When the operating point moves, predictions get a constant error. White noise does not explain it,
and the validation part of a record need not show it. A level estimated from the past fifty or so
errors removes it. If the errors are white this costs little: it raises their variance by half the
rate. Source: G. Box, G. Jenkins, Time Series Analysis, 1970, section 5.3 (the exponentially
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
"""Fraction of each error that is added to the level: a step is followed within some
fifty samples.
"""
LEVEL_POLE = 1 - 0.01 * LEVEL_RATE
"""Pole of the level, inside the unit circle: a hundredth of a step is never followed."""


def level_following(model: InnovationsModel) -> InnovationsModel:
    """The model with predictions to which the level of past errors is added.

    The model's own predictions are unchanged, and the level d of each output is added:

        d(t+1) = LEVEL_POLE d + LEVEL_RATE (y - yhat - d)

    There is one more state for each output, which starts at zero; responses stay the same.
    """
    ny = len(model.C)
    one = np.eye(ny)
    A = block_diag(model.A, LEVEL_POLE * one)
    # The model's predictor is driven by its own error: the new error plus the level.
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
    """Errors (N, ny) of predictions to which the level of past errors is added, from zero."""
    found = lfilter([1.0, -LEVEL_POLE], [1.0, LEVEL_RATE - LEVEL_POLE], errors, axis=0)
    return np.asarray(found)
