"""Scores of a control loop over an ensemble of circumstances, with bootstrap intervals.

Every circumstance belongs to a group: the cause of what goes wrong in it. The mean score of each
group is an arm of a star-shaped figure, the balloon; the mean length of its arms is one number for
the whole ensemble (E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003),
section 2.6; B. Efron, R. Tibshirani, An Introduction to the Bootstrap (1993), chapter 13).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench._core.arrays import RealArray
from workbench._core.compiled import compiled
from workbench.errors import InputError

BOOTSTRAP_SAMPLES, CONFIDENCE = 1000, 0.95
"""Bootstrap samples of an interval, and the probability with which it covers the true value."""
ARM_POWER = 0.25
"""An arm's length is a score between 0 and 1 to this power. So a score of 1e-4 is visible, at a
tenth of the full length.
"""


class ErrorScores(NamedTuple):
    """Scores of a loop: how small it kept its error.

    outside  share of the samples at which the error is above its acceptable size;
    losses   how often it passes the size at which the loop is lost;
    longest  samples of the longest stretch above the acceptable size;
    rms      root mean square, with larger errors counted as the size at which the loop is lost.

    Examples
    --------
    >>> from workbench.simulation import ErrorScores
    >>> ErrorScores(outside=0.1, losses=2, longest=30, rms=1e-7).losses
    2
    """

    outside: float
    losses: float
    longest: int
    rms: float


def error_scores(error: RealArray, acceptable: float, lost: float) -> ErrorScores:
    """Scores of an error (N,); its acceptable size and the size of loss are in its own unit.

    Raises InputError for an error without samples.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.simulation import error_scores
    >>> scores = error_scores(np.array([0.0, 0.5, 2.0, 0.5, 0.0]), acceptable=0.4, lost=1.0)
    >>> scores.outside, scores.losses, scores.longest
    (0.6, 1.0, 3)
    """
    if not len(error):
        raise InputError("the error has no samples, so there is nothing to score")
    outside, losses, longest, square = _counts_outside(np.asarray(error, float), acceptable, lost)
    samples = len(error)
    return ErrorScores(outside / samples, float(losses), longest, math.sqrt(square / samples))


@compiled
def _counts_outside(
    error: RealArray, acceptable: float, lost: float
) -> tuple[int, int, int, float]:
    """Samples outside, losses, the longest stretch outside, and the sum of the squares."""
    outside, losses, longest, stretch, square, away = 0, 0, 0, 0, 0.0, False
    for value in error:
        size = abs(value)
        stretch = stretch + 1 if size > acceptable else 0
        outside += size > acceptable
        longest = max(longest, stretch)
        losses += size > lost and not away
        away = size > lost
        square += min(size, lost) ** 2
    return outside, losses, longest, square


def group_means(
    score: RealArray, group: NDArray[np.int64], *, weight: RealArray | None = None
) -> RealArray:
    """Mean score of every group (..., groups), from scores (..., circumstances).

    group (circumstances,): numbers of the groups, from 0 on. weight (W, circumstances): how often
    each circumstance counts, as `bootstrap_weights` gives them; the result is (..., W, groups)
    then. A group whose weights are all zero has the mean NaN.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.simulation import group_means
    >>> group_means(np.array([0.1, 0.3, 0.5]), np.array([0, 0, 1])).tolist()
    [0.2, 0.5]
    """
    member = (group[:, None] == np.arange(group.max() + 1)).astype(float)
    weights = np.ones((1, len(group))) if weight is None else weight
    count = weights @ member
    with np.errstate(invalid="ignore"):
        means: RealArray = (
            np.einsum("...c,wc,cg->...wg", score, weights, member, optimize=True) / count
        )
    return means[..., 0, :] if weight is None else means


def balloon_size(means: ArrayLike, *, power: float = ARM_POWER) -> RealArray:
    """Mean length of the arms (...,) of balloons whose groups have means (..., groups).

    An arm is the mean score to the `power`, so that small shares of time remain visible beside
    large ones.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.simulation import balloon_size
    >>> float(balloon_size(np.array([0.0, 1.0, 1.0, 1.0])))
    0.75
    """
    mean: RealArray = np.mean(np.asarray(means, float) ** power, axis=-1)
    return mean


def bootstrap_weights(
    group: NDArray[np.int64], rng: np.random.Generator, *, samples: int = BOOTSTRAP_SAMPLES
) -> RealArray:
    """Weights (samples, circumstances): each group drawn from itself, with replacement.

    Only the circumstances are drawn; every group keeps its size. Raises InputError below 2 samples.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.simulation import bootstrap_weights
    >>> group = np.array([0, 0, 1, 1, 1])
    >>> weights = bootstrap_weights(group, np.random.default_rng(0), samples=100)
    >>> weights.shape, set(weights[:, :2].sum(axis=1).tolist())
    ((100, 5), {2.0})
    """
    if samples < 2:
        raise InputError(f"{samples} bootstrap samples; an interval needs 2 or more")
    weights = np.zeros((samples, len(group)))
    for number in range(group.max() + 1):
        own = np.flatnonzero(group == number)
        even = np.full(len(own), 1.0 / len(own))
        weights[:, own] = rng.multinomial(len(own), even, size=samples)
    return weights


def percentile_interval(samples: RealArray, *, confidence: float = CONFIDENCE) -> RealArray:
    """Both ends (2, ...) of the percentile interval of bootstrap samples (..., samples).

    Raises InputError unless 0 < confidence < 1.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.simulation import percentile_interval
    >>> percentile_interval(np.arange(101.0), confidence=0.9).round(6).tolist()
    [5.0, 95.0]
    """
    if not 0.0 < confidence < 1.0:
        raise InputError(f"confidence is {confidence}; it must be above 0 and below 1")
    tail = (1.0 - confidence) / 2
    ends: RealArray = np.quantile(samples, [tail, 1.0 - tail], axis=-1)
    return ends
