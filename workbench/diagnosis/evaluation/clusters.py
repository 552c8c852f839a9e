"""Isolation by clusters: the features of each kind of fault have a Gaussian distribution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats
from scipy.linalg import solve_triangular

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.input_checks import as_array, need_numbers, need_whole

Whole = NDArray[np.int64]

UNKNOWN = -1
"""The number for features that are far from every cluster."""
LARGEST_CORRELATION_CONDITION = 1e10
"""Largest condition number of a cluster's correlation matrix; beyond it the cluster is flat."""


@dataclass(frozen=True, eq=False)
class Clusters:
    """A Gaussian for each kind of fault: means (K, n), covariances' Cholesky factors (K, n, n).

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.diagnosis import Clusters
    >>> rng, kinds = np.random.default_rng(0), np.repeat([0, 1], 50)
    >>> features = rng.standard_normal((100, 2)) + 10.0 * kinds[:, None]
    >>> clusters = Clusters.fit(features, kinds, ("scratch", "fingerprint"))
    >>> clusters.classify([[0.0, 0.0], [10.0, 10.0]]).tolist()
    [0, 1]
    """

    names: tuple[str, ...]
    means: RealArray
    factors: RealArray

    @classmethod
    def fit(cls, features: ArrayLike, labels: ArrayLike, names: Sequence[str]) -> Clusters:
        """The clusters with the mean and the covariance of the features (N, n) of each kind.

        The label of a sample (N,) is the index of its kind in the names. Raises InputError for
        shapes that do not match, features that are not finite, and labels without a name; and for a
        kind with a singular covariance: it has too few samples, or a feature does not vary or is a
        linear combination of others.
        """
        if not isinstance(names, Sequence):
            raise InputError(f"names are {names!r}; a list of names is needed")
        points, kinds = _features(features), _labels("labels", labels, len(names))
        if len(kinds) != len(points):
            raise InputError(f"{len(points)} features and {len(kinds)} labels; need equally many")
        fits = [_gaussian(name, points[kinds == k]) for k, name in enumerate(names)]
        means, factors = zip(*fits, strict=True)
        return cls(tuple(names), np.array(means), np.array(factors))

    def distances(self, features: ArrayLike) -> RealArray:
        """Squared Mahalanobis distances (N, K) of features (N, n) from every cluster."""
        points = _features(features)
        if points.shape[1] != self.means.shape[1]:
            raise InputError(
                f"{points.shape[1]} features; the clusters were made of {self.means.shape[1]}"
            )
        white = [
            solve_triangular(factor, (points - mean).T, lower=True)
            for mean, factor in zip(self.means, self.factors, strict=True)
        ]
        return np.stack([np.sum(one**2, axis=0) for one in white], axis=1)

    def classify(self, features: ArrayLike, *, reject: float = 0.0) -> Whole:
        """The most likely kind (N,) of each sample, if all kinds are equally frequent.

        A sample is UNKNOWN if it is so far from every cluster that only a share `reject` of the
        cluster's own samples are farther. Raises InputError unless 0 <= reject < 1, and as
        `distances`.
        """
        need_numbers(reject=reject)
        if not 0.0 <= reject < 1.0:
            raise InputError(f"reject is {reject}; it is a share, 0 or more and below 1")
        squared = self.distances(features)
        volume = 2.0 * np.log(np.diagonal(self.factors, axis1=1, axis2=2)).sum(axis=1)
        found = np.argmin(squared + volume, axis=1)
        far = squared.min(axis=1) > stats.chi2.isf(reject, self.means.shape[1])
        return np.where(far, UNKNOWN, found).astype(np.int64)


def confusion_matrix(true: ArrayLike, found: ArrayLike, kinds: int) -> Whole:
    """Confusion matrix (K, K + 1): how many samples of a true kind (row) got which kind (column).

    The last column counts negative numbers, which stand for none of the kinds. Raises InputError
    for different lengths and for numbers of kinds that do not exist.

    Examples
    --------
    >>> from workbench.diagnosis import confusion_matrix
    >>> confusion_matrix([0, 0, 1, 1], [0, 1, 1, -1], kinds=2).tolist()
    [[1, 1, 0], [0, 1, 1]]
    """
    need_whole(kinds, "kinds")
    rows = _labels("true", true, kinds)
    columns = as_array(found, "found")
    if (columns % 1 != 0.0).any():
        raise InputError(f"found {found!r}: need whole numbers")
    columns = columns.astype(np.int64)
    if rows.shape != columns.shape:
        raise InputError(f"{len(rows)} true kinds, {columns.shape} found; need equally many")
    columns = _labels("found", np.where(columns < 0, kinds, columns), kinds + 1)
    counts = np.zeros((kinds, kinds + 1), np.int64)
    np.add.at(counts, (rows, columns), 1)
    return counts


def _gaussian(name: str, points: RealArray) -> tuple[RealArray, RealArray]:
    count, n = points.shape
    flat = f"cluster {name!r}: singular covariance of {n} features from {count} samples"
    if count <= n:
        raise InputError(f"{flat}; at least {n + 1} needed")
    spread = points.std(axis=0, ddof=1)
    still = np.flatnonzero(spread <= 1e-12 * abs(points).max(axis=0))
    if still.size:
        raise InputError(f"{flat}; features {still.tolist()} do not vary")
    correlation = np.atleast_2d(np.corrcoef(points, rowvar=False))
    if np.linalg.cond(correlation) > LARGEST_CORRELATION_CONDITION:
        raise InputError(f"{flat}; a feature is a combination of others")
    return points.mean(axis=0), spread[:, None] * np.linalg.cholesky(correlation)


def _features(features: ArrayLike) -> RealArray:
    points = as_array(features, "features")
    if points.ndim != 2 or not points.size or not np.isfinite(points).all():
        raise InputError(
            f"features have shape {points.shape}; they must be (N, n), finite, not none"
        )
    return points


def _labels(name: str, labels: ArrayLike, kinds: int) -> Whole:
    numbers = np.asarray(labels)
    whole = numbers.ndim == 1 and numbers.size > 0 and np.issubdtype(numbers.dtype, np.integer)
    if not whole or numbers.min() < 0 or numbers.max() >= kinds:
        raise InputError(f"{name} {numbers!r}: need a 1-D array of whole numbers, 0 to {kinds - 1}")
    return numbers.astype(np.int64)
