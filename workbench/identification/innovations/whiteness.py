"""Test whether one-step errors are white; if not, the model lacks a part of plant or noise.

The past errors of a wrong model predict a part of its next error that no change of its parameters
can remove. The test accounts for the parameters that were fitted to the same errors, so it is also
right for few samples and for many parameters.

Source: L. Godfrey, Misspecification Tests in Econometrics, 1988, section 4.4 (the test by Lagrange
multipliers for errors that depend on each other).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import chi2

from workbench._core.arrays import RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.criterion import Criterion, whitening
from workbench.identification.innovations.curvature import root_of_inverse
from workbench.identification.innovations.model import InnovationsModel

LAGS = 12
"""Number of past errors [samples] of each output that the test uses."""
CHANCE = 0.01
"""Errors count as dependent if chance alone explains them with a smaller probability than this."""


@dataclass(frozen=True)
class Whiteness:
    """Share of the errors' variance that past errors predict, and its probability by chance."""

    share: float
    chance: float

    @property
    def words(self) -> str:
        """What was found, in words."""
        chance = f"by chance with probability {self.chance:.2g}"
        return f"the last {LAGS} errors tell {self.share:.2g} of the next one's variance, {chance}"

    @property
    def holds(self) -> bool:
        """Whether the errors are white, as far as the record tells."""
        return self.chance >= CHANCE


def model_whiteness(model: InnovationsModel, record: Experiments, direct: bool) -> Whiteness:
    """Whether a model's one-step errors on a record are white; ``direct``: whether D is free."""
    criterion = Criterion(model, record, 0.0, direct)
    return whiteness_of_errors(criterion, criterion.start(model))


def whiteness_of_errors(criterion: Criterion, theta: RealArray) -> Whiteness:
    """Whether the one-step errors of a criterion's parameters (P,) are white."""
    errors = criterion.errors(theta)
    outputs = errors.shape[1]
    _, gradient, hessian = criterion.expand(theta)
    whiten = whitening(errors.T @ errors / len(errors) + criterion.floor)
    white = errors @ whiten
    past = np.zeros((len(white), outputs, LAGS))
    for lag in range(1, min(LAGS, len(white) - 1) + 1):
        past[lag:, :, lag - 1] = white[:-lag]
    root, first = root_of_inverse(hessian), 0
    crossed = np.zeros((len(theta), outputs * LAGS))
    for columns, rows in criterion.filtered_rows(theta, [np.ones(1)] * outputs):
        each = np.einsum("toc,op,tpk->cpk", rows, whiten, past[first : first + len(rows)])
        crossed[columns] += each.reshape(len(columns), -1)
        first += len(rows)
    told = root.T @ crossed
    own = block_diag(*np.einsum("tok,tol->okl", past, past))
    score = np.einsum("tok,to->ok", past, white).ravel() - told.T @ (root.T @ gradient)
    left = own - told.T @ told
    size = float(score @ np.linalg.pinv(left, hermitian=True) @ score)
    return Whiteness(size / white.size, float(chi2.sf(size, len(score))))
