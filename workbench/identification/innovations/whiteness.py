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

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag
from scipy.signal import lfilter
from scipy.stats import chi2

from workbench._core.arrays import IntegerArray, RealArray
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
    errors = whitened_errors(criterion, theta)
    white = errors.white
    past = np.zeros((*white.shape, LAGS))
    for lag in range(1, min(LAGS, len(white) - 1) + 1):
        past[lag:, :, lag - 1] = white[:-lag]
    beside = added_regressors(errors, free, past)
    factors = roots_where_new(beside.inner, beside.sizes)
    found = factors.T @ beside.score
    size = float(found @ found)
    moves = beside.root @ beside.told @ factors @ np.column_stack([found, np.eye(len(found))])
    return Whiteness(size / white.size, float(chi2.sf(size, len(found))), moves)


@dataclass(frozen=True, eq=False)
class WhitenedErrors:
    """One-step errors of a criterion's parameters, made independent with variance 1.

    Each output's errors pass a filter of ``filters``, a polynomial in the delay of a sample. Then
    the matrix ``whiten`` (ny, ny) makes them ``white`` (N, ny).
    """

    criterion: Criterion
    theta: RealArray
    filters: list[RealArray]
    white: RealArray
    whiten: RealArray

    def rows(self) -> Iterator[tuple[slice, IntegerArray, RealArray]]:
        """Samples of a block, the columns of its parameters, and derivatives (T, ny, columns)."""
        first = 0
        for columns, rows in self.criterion.filtered_rows(self.theta, self.filters):
            block = slice(first, first + len(rows))
            yield block, columns, np.einsum("toc,op->tpc", rows, self.whiten)
            first = block.stop


def whitened_errors(
    criterion: Criterion, theta: RealArray, filters: list[RealArray] | None = None
) -> WhitenedErrors:
    """Errors of parameters (P,), through a filter for each output; None: through none."""
    errors = criterion.errors(theta)
    if filters is None:
        filters = [np.ones(1)] * errors.shape[1]
    else:
        columns = zip(filters, errors.T, strict=True)
        errors = np.column_stack([lfilter(a, 1.0, v) for a, v in columns])
    whiten = whitening(errors.T @ errors / len(errors) + criterion.floor)
    return WhitenedErrors(criterion, theta, filters, errors @ whiten, whiten)


@dataclass(frozen=True, eq=False)
class AddedRegressors:
    """Regressors (m,) that are added to the parameters of a criterion, to tell its errors.

    ``root`` (P, q): the parameters' standard deviations; ``slope`` (q,): of the criterion along
    them, zero at its minimum; ``told`` (q, m): the part of the regressors along them; ``inner``
    (m, m): inner products of the rest; ``sizes`` (m,): of the whole; ``score`` (m,): inner products
    of the rest with the errors.
    """

    root: RealArray
    slope: RealArray
    told: RealArray
    inner: RealArray
    sizes: RealArray
    score: RealArray


def added_regressors(errors: WhitenedErrors, free: RealArray, added: RealArray) -> AddedRegressors:
    """What is new in regressors ``added`` (N, ny, k) of the whitened errors of each output."""
    outputs, count = added.shape[1:]
    size = len(errors.theta)
    gradient, hessian = np.zeros(size), np.zeros((size, size))
    crossed = np.zeros((size, outputs * count))
    for block, columns, slopes in errors.rows():
        gradient[columns] += np.einsum("tpc,tp->c", slopes, errors.white[block])
        flat = slopes.reshape(-1, len(columns))
        hessian[np.ix_(columns, columns)] += flat.T @ flat
        each = np.einsum("tpc,tpk->cpk", slopes, added[block])
        crossed[columns] += each.reshape(len(columns), -1)
    root = free @ root_of_inverse(free.T @ hessian @ free)
    slope, told = root.T @ gradient, root.T @ crossed
    own = block_diag(*np.einsum("tok,tol->okl", added, added))
    score = np.einsum("tok,to->ok", added, errors.white).ravel() - told.T @ slope
    return AddedRegressors(root, slope, told, own - told.T @ told, np.diag(own), score)


def roots_where_new(inner: RealArray, sizes: RealArray) -> RealArray:
    """F (m, k) with F F' the inverse of inner products (m, m), where these are not too small.

    ``sizes`` (m,) are inner products of the whole regressors, of which the rest may be rounding.
    """
    scale = np.sqrt(np.maximum(sizes, np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(inner / np.outer(scale, scale))
    new = values > NEW
    return np.asarray(vectors[:, new] / scale[:, None] / np.sqrt(values[new]))
