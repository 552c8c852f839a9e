"""The balloon of section 2.6 as numbers: an arm for every cause, and how sure each arm is.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.arrays import RealArray
from workbench.errors import InputError

BOOTSTRAP, LEVEL = 1000, 0.95
"""Samples, and level, of every confidence interval."""
POWER = 0.25
"""Of the share of time out of spec that an arm is long: from 0 in the centre, 1e-4 at a tenth of
the way, to all of the time at 1."""


def arms(out: RealArray, group: NDArray[np.int64], weight: RealArray | None = None) -> RealArray:
    """Mean share of time out of spec of every group (..., groups) of runs (..., circumstances).

    group (circumstances,): numbers from 0 on. weight (W, circumstances): how often each counts;
    then (..., W, groups). A group whose weights are all zero has the arm NaN.
    """
    member = (group[:, None] == np.arange(group.max() + 1)).astype(float)
    weights = np.ones((1, len(group))) if weight is None else weight
    count = weights @ member
    with np.errstate(invalid="ignore"):
        means: RealArray = (
            np.einsum("...c,wc,cg->...wg", out, weights, member, optimize=True) / count
        )
    return means[..., 0, :] if weight is None else means


def size(arm: ArrayLike) -> RealArray:
    """Size of balloons (...,) with arms (..., groups): the mean length of an arm."""
    mean: RealArray = np.mean(np.asarray(arm, float) ** POWER, axis=-1)
    return mean


def resampled(group: NDArray[np.int64], samples: int, rng: np.random.Generator) -> RealArray:
    """Bootstrap weights (samples, circumstances): each group drawn from itself, with replacement.

    Circumstances are what is random; drives are all met by each. Raises InputError below 2 samples.
    """
    if samples < 2:
        raise InputError(f"{samples} bootstrap samples; an interval needs 2 or more")
    weights = np.zeros((samples, len(group)))
    for number in range(group.max() + 1):
        own = np.flatnonzero(group == number)
        even = np.full(len(own), 1.0 / len(own))
        weights[:, own] = rng.multinomial(len(own), even, size=samples)
    return weights


def interval(samples: RealArray) -> RealArray:
    """Percentile interval (2, ...) of bootstrap samples (..., samples)."""
    tail = (1.0 - LEVEL) / 2
    ends: RealArray = np.quantile(samples, [tail, 1.0 - tail], axis=-1)
    return ends
