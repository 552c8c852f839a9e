"""Test whether the past of y predicts u better than u's own past alone.

The surprise of u is the part that its own past does not predict. In an open loop no past of y
predicts any of it (Granger 1969; Caines and Chan 1975: feedback from y to u). Two things look like
feedback but are not. First, the recorded u may be the true one plus white sensor noise: y responds
to the true u, and so predicts the part of it that the noise hides. So the hypothesis is "open loop,
u with white noise of some variance". Every variance that u's own spectrum allows is tried, with the
noise removed from the normal equations (Frisch's scheme; Soderstrom 2007, Errors-in-variables
methods in system identification, Automatica 43). Second, a predictable u (sines, sweeps, few steps)
has a surprise that is merely its prediction error: it is not white, or it is small, or it comes
from a few samples.

The statistic is a score: the sum over samples of the products of surprise and past y, normalised by
the matrix of the summed squares of these products (White 1980). So neither a few large steps nor
changing noise have much weight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from workbench._core.arrays import RealArray
from workbench.identification.record_tests.loop.memories import VARIANCE_ROUNDING, Memory

NOISE_SHARE = 0.01
"""Largest share of a recorded u's variance that can be sensor noise."""
NOISE_STEPS = np.array([0.0, 0.3, 0.6, 0.8, 0.9, 0.95])
"""Variances of that noise that are tried, relative to the largest that u's spectrum allows."""
OUTLYING = 1.5
"""Surprises larger than this many robust standard deviations get less weight (Huber 1964)."""
REWEIGHTED, REWEIGHTED_ROWS = 5, 20_000
"""Number of reweighting passes, and number of samples that they use."""
WHITE_LAGS = 32
"""Lags at which a surprise must be white."""
LEAST_SIZE, LARGE_SIZE = 1e-3, 0.1
"""Size of the surprise relative to u: below the first it is rounding; above the second u is not a
smooth signal.
"""
NEARBY, WINDOW, SWEPT = 8, 128, 0.5
"""For sweeps: number of samples that predict the next one in a window, length of the window, and
largest share of the surprise that may remain there.
"""
MOSTLY_NOISE, AMPLIFIED_NOISE = 0.5, 0.3
"""If u's sensor noise can make more than these shares of a surprise, directly or through u's past,
nothing is known about u itself: the noise is known too poorly to remove it from the equations.
"""
FEWEST_EFFECTIVE = 30.0
"""Least effective number of samples that must make up a surprise."""
COLOURED, COLOURED_LARGE = 4.0, 8.0
"""A surprise counts as white if its squared autocorrelations, relative to their variance, are below
the first number. For a large surprise the second applies, since a clocked excitation causes some
colour that is not a prediction error.
"""


@dataclass(frozen=True)
class Prediction:
    """Prediction of an input, with equal weights or with less weight on large surprises.

    Parameters
    ----------
    size
        Standard deviation of the surprise over that of u.
    effective
        Effective number of samples in the surprise: (sum a^2)^2 / sum a^4.
    coloured
        Mean of the squared autocorrelations of the surprise, relative to their variance: 1 if it is
        white.
    explained
        Share of the surprise that y's past predicts, by cross-validation between folds of the
        record.
    chance
        Probability of predicting so much in an open loop, for the sensor noise of u that makes it
        largest.
    chance_without_noise
        The same probability if u is recorded without noise.
    swept
        Whether u is predicted far better by its recent past than by one rule for the whole record.
    noise, amplified_noise
        Largest shares of the surprise that u's sensor noise can make: at the same sample, and
        through the past of u.
    """

    size: float
    effective: float
    coloured: float
    explained: float
    chance: float
    chance_without_noise: float
    swept: bool
    noise: float
    amplified_noise: float

    @property
    def rounding(self) -> bool:
        """Whether u's own past predicts it up to rounding."""
        return self.size < LEAST_SIZE

    @property
    def noisy(self) -> bool:
        """Whether the surprise may be noise of u's sensor."""
        return self.noise > MOSTLY_NOISE or self.amplified_noise > AMPLIFIED_NOISE

    @property
    def clocked(self) -> bool:
        """Whether the surprise is large and coloured, as for levels that change with a clock."""
        return self.size >= LARGE_SIZE and self.coloured > COLOURED_LARGE

    @property
    def doubt(self) -> str:
        """The reason why a small probability proves nothing; empty if it does."""
        if self.rounding:
            return "is predicted to rounding by its own past"
        if self.effective < FEWEST_EFFECTIVE:
            return f"changes by itself at about {self.effective:.0f} samples only"
        if self.swept:
            return "is a sweep: it is predicted by its own past nearby"
        if self.noisy:
            return "moves little beyond what may be white noise of its sensor"
        if self.size < LARGE_SIZE and self.coloured > COLOURED:
            return "is too smooth: what its own past does not tell of it is not white"
        return ""


def input_predictions(rows: Memory, channel: int) -> tuple[Prediction, Prediction]:
    """Predictions by least squares, and with less weight on large surprises."""
    u = rows.u[:, channel]
    scale = np.sqrt(np.mean(rows.past_u**2, axis=0)) + np.finfo(float).tiny
    P, own = rows.past_u / scale, rows.noise / scale**2
    nearby = _unpredicted_nearby(u)
    alike = _prediction(P, own, u, rows.past_y, np.ones(len(u)), nearby)
    weighted = _prediction(P, own, u, rows.past_y, _weights(P, u), nearby)
    # Noise is in every sample, so its possible size is found with equal weights.
    noise, amplified = alike.noise, alike.amplified_noise
    return alike, replace(weighted, noise=noise, amplified_noise=amplified)


def _unpredicted_nearby(u: RealArray) -> float:
    """Energy that regressions on the last few samples leave unpredicted, each in its window."""
    windows = u[: len(u) // WINDOW * WINDOW].reshape(-1, WINDOW)
    lags = np.lib.stride_tricks.sliding_window_view(windows, NEARBY + 1, axis=1)
    columns, target = lags[..., :-1], lags[..., -1:]
    gram = columns.swapaxes(1, 2) @ columns
    ridge = (
        VARIANCE_ROUNDING * np.trace(gram, axis1=1, axis2=2)[:, None, None] + np.finfo(float).tiny
    )
    theta = np.linalg.solve(gram + ridge * np.eye(NEARBY), columns.swapaxes(1, 2) @ target)
    left = float(np.sum((target - columns @ theta) ** 2))
    return left * len(u) / max(len(windows) * (WINDOW - 2 * NEARBY), 1)


def _gram(P: RealArray, Q: RealArray, weight: RealArray) -> RealArray:
    return (P * (weight / weight.sum())[:, None]).T @ Q


def _weights(P: RealArray, u: RealArray) -> RealArray:
    """Huber's weights of the surprises."""
    some = slice(None, None, max(1, len(u) // REWEIGHTED_ROWS))
    weight, part, target = np.ones(len(u[some])), P[some], u[some]
    ridge = VARIANCE_ROUNDING * np.eye(P.shape[1])
    for _ in range(REWEIGHTED):
        theta = np.linalg.solve(_gram(part, part, weight) + ridge, _gram(part, target, weight))
        robust = np.median(np.abs(target - part @ theta)) / stats.norm.ppf(0.75)
        bound = OUTLYING * max(robust, np.sqrt(VARIANCE_ROUNDING) * u.std())
        weight = np.minimum(1.0, bound / np.maximum(np.abs(target - part @ theta), bound))
    return np.minimum(1.0, bound / np.maximum(np.abs(u - P @ theta), bound))


def _prediction(
    P: RealArray, noise: RealArray, u: RealArray, Z: RealArray, weight: RealArray, nearby: float
) -> Prediction:
    """Surprise a = u - P alpha and z = Z - P Gamma, with the noise s D of u removed.

    In an open loop their normal equations give E[w (z a - s Gamma' D alpha)] = 0.
    """
    G = _gram(P, P, weight) + VARIANCE_ROUNDING * np.eye(P.shape[1])
    targets = _gram(P, np.column_stack([u, Z]), weight)
    root = np.sqrt(noise)
    alpha = np.linalg.solve(G, targets[:, 0])
    surprise = u - P @ alpha
    # The noise is in every row of u and of its past, so its variance is at most what either allows.
    amplified, mean_square = alpha @ (noise * alpha), np.average(surprise**2, weights=weight)
    largest = min(
        NOISE_SHARE,
        1 / np.linalg.eigvalsh(np.linalg.inv(G) * np.outer(root, root))[-1],
        mean_square / (u.var() + amplified),
    )
    chances = []
    for share in NOISE_STEPS * largest:
        theta = np.linalg.solve(G - share * np.diag(noise), targets)
        alpha, gamma = theta[:, 0], theta[:, 1:]
        a, z = u - P @ alpha, Z - P @ gamma
        terms = weight[:, None] * (z * a[:, None] - share * gamma.T @ (noise * alpha))
        chances.append(_score(terms))
        if share == 0.0:
            surprise, told = weight * a, z * weight[:, None]
    energy = np.sum(surprise**2)
    return Prediction(
        size=float(np.sqrt(energy / len(u)) / u.std()),
        effective=float(energy**2 / np.sum(surprise**4)) if energy > 0 else 0.0,
        coloured=_coloured(surprise),
        explained=_explained(surprise, told),
        chance=max(chances),
        chance_without_noise=chances[0],
        swept=bool(nearby < SWEPT * energy),
        noise=float(largest * u.var() * len(u) / energy),
        amplified_noise=float(largest * amplified / mean_square),
    )


def _score(terms: RealArray) -> float:
    """Probability of a mean of terms (N, q) at least as far from zero, by Hotelling's T^2."""
    n, q = terms.shape
    terms = terms / (np.sqrt(np.sum(terms**2, axis=0)) + np.finfo(float).tiny)
    total = terms.sum(axis=0)
    found = total @ np.linalg.lstsq(terms.T @ terms, total, rcond=1e-8)[0]
    found = min(found, n * (1 - 1e-12))
    return float(stats.f.sf((n - q) / q * found / (n - found), q, n - q)) if n > 2 * q else 1.0


def _coloured(a: RealArray) -> float:
    """Mean over lags of (sum a_k a_k+j)^2 / sum a_k^2 a_k+j^2, which is 1 if a is white."""

    def correlated(x: RealArray) -> RealArray:
        spectrum = np.fft.rfft(x, 2 * len(x))
        return np.fft.irfft(np.abs(spectrum) ** 2)[1 : WHITE_LAGS + 1]

    both = np.maximum(correlated(a**2), np.finfo(float).tiny)
    return float(np.mean(correlated(a) ** 2 / both))


def _explained(a: RealArray, z: RealArray, folds: int = 4) -> float:
    """Share of a that z predicts in each fold, with coefficients from the other folds."""
    fold = np.arange(len(a)) * folds // len(a)
    inner = [(z[fold == i].T @ z[fold == i], z[fold == i].T @ a[fold == i]) for i in range(folds)]
    left = 0.0
    for i in range(folds):
        G = sum(inner[j][0] for j in range(folds) if j != i)
        c = sum(inner[j][1] for j in range(folds) if j != i)
        b = np.linalg.lstsq(G, c, rcond=1e-9)[0]
        left += float(np.sum((a[fold == i] - z[fold == i] @ b) ** 2))
    return 1.0 - left / max(float(np.sum(a**2)), np.finfo(float).tiny)
