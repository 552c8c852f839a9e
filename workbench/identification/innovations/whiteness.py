"""Test whether one-step errors are white; if not, the model lacks a part of plant or noise.

The past errors of a wrong model predict a part of its next error that no change of its parameters
can remove. The test accounts for the parameters that were fitted to the same errors, so it is also
right for few samples and for many parameters.

Source: L. Godfrey, Misspecification Tests in Econometrics, 1988, section 4.4 (the test by Lagrange
multipliers for errors that depend on each other).

In a loop, noise that its model lacks biases the plant before the errors show it. So the test also
tells how the parameters would change if the next error were free to depend on the past ones. To
first order that is the estimate with a noise model of `LAGS` further parameters, less the estimate
itself: Hausman's comparison of an efficient estimate with one that assumes less.

Source: J. Hausman, "Specification tests in econometrics", Econometrica 46(6), 1978.
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
NEW = 1e-4
"""Least share of the past errors' power, in a direction, that no change of parameters explains."""


@dataclass(frozen=True, eq=False)
class Whiteness:
    """Share of the errors' variance that past errors tell, and how probable that is by chance.

    ``moves`` (P, k) are changes of the parameters: in its first column the one that follows if the
    next error may depend on past ones, in the others its standard deviations by chance.
    """

    share: float
    chance: float
    moves: RealArray

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
    theta = criterion.start(model)
    return whiteness_of_errors(criterion, theta, np.eye(len(theta)))


def whiteness_of_errors(criterion: Criterion, theta: RealArray, free: RealArray) -> Whiteness:
    """Whether the one-step errors of a criterion's parameters (P,) are white.

    The parameters were free along the columns of ``free`` (P, q).
    """
    errors = criterion.errors(theta)
    outputs = errors.shape[1]
    _, gradient, hessian = criterion.expand(theta)
    whiten = whitening(errors.T @ errors / len(errors) + criterion.floor)
    white = errors @ whiten
    past = np.zeros((len(white), outputs, LAGS))
    for lag in range(1, min(LAGS, len(white) - 1) + 1):
        past[lag:, :, lag - 1] = white[:-lag]
    root, first = free @ root_of_inverse(free.T @ hessian @ free), 0
    crossed = np.zeros((len(theta), outputs * LAGS))
    for columns, rows in criterion.filtered_rows(theta, [np.ones(1)] * outputs):
        each = np.einsum("toc,op,tpk->cpk", rows, whiten, past[first : first + len(rows)])
        crossed[columns] += each.reshape(len(columns), -1)
        first += len(rows)
    told = root.T @ crossed
    own = block_diag(*np.einsum("tok,tol->okl", past, past))
    score = np.einsum("tok,to->ok", past, white).ravel() - told.T @ (root.T @ gradient)
    scale = np.sqrt(np.maximum(np.diag(own), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh((own - told.T @ told) / np.outer(scale, scale))
    new = values > NEW
    factors = vectors[:, new] / scale[:, None] / np.sqrt(values[new])
    found = factors.T @ score
    size = float(found @ found)
    moves = root @ told @ factors @ np.column_stack([found, np.eye(len(found))])
    return Whiteness(size / white.size, float(chi2.sf(size, len(found))), moves)
