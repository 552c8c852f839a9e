"""Does the past of y tell what u does next, beyond what u's own past tells?

What of u its own past does not tell is its surprise. In an open loop no past of y tells anything of
it (Granger 1969; Caines and Chan 1975: feedback from y to u). Two things look like feedback and are
none. A recorded u may be the true one and white noise of its sensor: y, which answers to the true
one, then tells of it what the noise hides. So the hypothesis is "open loop, u with white noise of
some variance", and every variance that u's own spectrum allows is tried, with the normal equations
freed from it (Frisch's scheme; Soderstrom 2007, Errors-in-variables methods in system
identification, Automatica 43). And a u without surprise (sines, sweeps, few steps) leaves a
surprise that is but an error of its prediction: it is not white, small, or few samples make it up.

The statistic is a score: the products of surprise and past y, each by itself, over the sum of their
squares (White 1980), so that neither a few large steps nor changing noise count for much.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from workbench._core.arrays import RealArray
from workbench.identification.record_tests.loop.memories import ROUNDING, Memory

NOISE_SHARE = 0.01
"""Largest share of a recorded u's variance that noise of its sensor may have."""
NOISE_STEPS = np.array([0.0, 0.3, 0.6, 0.8, 0.9, 0.95])
"""Variances of that noise that are tried, over the largest that the spectrum of u allows."""
OUTLYING = 1.5
"""Robust standard deviations from which on a surprise is weighed down (Huber 1964)."""
REWEIGHTED, REWEIGHTED_ROWS = 5, 20_000
"""Passes of the weighing, and samples that it looks at."""
WHITE_LAGS = 32
"""Lags at which a surprise must be white."""
LEAST_SIZE, LARGE_SIZE = 1e-3, 0.1
"""Surprises over u below which they are rounding, and above which u is no smooth signal."""
NEARBY, WINDOW, SWEPT = 8, 128, 0.5
"""Samples that predict the next one in a window, samples of a window, and the largest share of the
surprise that is left there of a sweep."""
MOSTLY_NOISE, AMPLIFIED_NOISE = 0.5, 0.3
"""Shares of a surprise that noise of u's sensor may be, and may make through u's past, above which
nothing is known of u's own: the noise is known too little to free the equations from it."""
FEWEST_EFFECTIVE = 30.0
"""Samples that must make up a surprise."""
COLOURED, COLOURED_LARGE = 4.0, 8.0
"""Squared autocorrelations over their variance up to which a surprise counts as white; where it is
large, some colour is that of a clocked excitation, and no error of a prediction."""


@dataclass(frozen=True)
class Prediction:
    """How an input is predicted, with all surprises alike or with large ones weighed down.

    Parameters
    ----------
    size
        Standard deviation of the surprise over that of u.
    effective
        Samples that make up the surprise: (sum a^2)^2 / sum a^4.
    coloured
        Mean of the squared autocorrelations of the surprise, over their variance: 1 if white.
    explained
        Share of the surprise that y's past predicts, between folds of the record.
    chance
        Probability of so much prediction in an open loop, for the noise of u that makes it largest.
    chance_without_noise
        The same where u is recorded without noise.
    swept
        Whether u is predicted far better by its past nearby than by one rule for all the record.
    noise, amplified_noise
        Largest shares of the surprise that noise of u's sensor may be at the same sample, and may
        make through the past of u.
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
        """Whether u is predicted by its own past to rounding."""
        return self.size < LEAST_SIZE

    @property
    def noisy(self) -> bool:
        """Whether the surprise may be that of the sensor of u."""
        return self.noise > MOSTLY_NOISE or self.amplified_noise > AMPLIFIED_NOISE

    @property
    def clocked(self) -> bool:
        """Whether the surprise is large and coloured, as that of levels that a clock changes."""
        return self.size >= LARGE_SIZE and self.coloured > COLOURED_LARGE

    @property
    def doubt(self) -> str:
        """Why nothing follows from a small chance; empty if it does."""
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
    """By least squares, and by weights that take large surprises down."""
    u = rows.u[:, channel]
    scale = np.sqrt(np.mean(rows.past_u**2, axis=0)) + np.finfo(float).tiny
    P, own = rows.past_u / scale, rows.noise / scale**2
    nearby = _unpredicted_nearby(u)
    alike = _prediction(P, own, u, rows.past_y, np.ones(len(u)), nearby)
    weighted = _prediction(P, own, u, rows.past_y, _weights(P, u), nearby)
    # Noise is in every sample: what it may be shows where all samples count alike.
    noise, amplified = alike.noise, alike.amplified_noise
    return alike, replace(weighted, noise=noise, amplified_noise=amplified)


def _unpredicted_nearby(u: RealArray) -> float:
    """Energy of what regressions on the last few samples do not predict, each in its own window."""
    windows = u[: len(u) // WINDOW * WINDOW].reshape(-1, WINDOW)
    lags = np.lib.stride_tricks.sliding_window_view(windows, NEARBY + 1, axis=1)
    columns, target = lags[..., :-1], lags[..., -1:]
    gram = columns.swapaxes(1, 2) @ columns
    ridge = ROUNDING * np.trace(gram, axis1=1, axis2=2)[:, None, None] + np.finfo(float).tiny
    theta = np.linalg.solve(gram + ridge * np.eye(NEARBY), columns.swapaxes(1, 2) @ target)
    left = float(np.sum((target - columns @ theta) ** 2))
    return left * len(u) / max(len(windows) * (WINDOW - 2 * NEARBY), 1)


def _gram(P: RealArray, Q: RealArray, weight: RealArray) -> RealArray:
    return (P * (weight / weight.sum())[:, None]).T @ Q


def _weights(P: RealArray, u: RealArray) -> RealArray:
    """Huber's weights of the surprises."""
    some = slice(None, None, max(1, len(u) // REWEIGHTED_ROWS))
    weight, part, target = np.ones(len(u[some])), P[some], u[some]
    ridge = ROUNDING * np.eye(P.shape[1])
    for _ in range(REWEIGHTED):
        theta = np.linalg.solve(_gram(part, part, weight) + ridge, _gram(part, target, weight))
        robust = np.median(np.abs(target - part @ theta)) / stats.norm.ppf(0.75)
        bound = OUTLYING * max(robust, np.sqrt(ROUNDING) * u.std())
        weight = np.minimum(1.0, bound / np.maximum(np.abs(target - part @ theta), bound))
    return np.minimum(1.0, bound / np.maximum(np.abs(u - P @ theta), bound))


def _prediction(
    P: RealArray, noise: RealArray, u: RealArray, Z: RealArray, weight: RealArray, nearby: float
) -> Prediction:
    """Surprise a = u - P alpha and z = Z - P Gamma, their normal equations freed from the noise s D
    of u: E[w (z a - s Gamma' D alpha)] = 0 in an open loop."""
    G = _gram(P, P, weight) + ROUNDING * np.eye(P.shape[1])
    targets = _gram(P, np.column_stack([u, Z]), weight)
    root = np.sqrt(noise)
    alpha = np.linalg.solve(G, targets[:, 0])
    surprise = u - P @ alpha
    # The noise is in every row of u and of its past: there is no more of it than either allows.
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
    """Probability of a mean of terms (N, q) as far from zero, by Hotelling's T^2 about zero."""
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
    """Share of a that z predicts in each fold, with coefficients of the other folds."""
    fold = np.arange(len(a)) * folds // len(a)
    inner = [(z[fold == i].T @ z[fold == i], z[fold == i].T @ a[fold == i]) for i in range(folds)]
    left = 0.0
    for i in range(folds):
        G = sum(inner[j][0] for j in range(folds) if j != i)
        c = sum(inner[j][1] for j in range(folds) if j != i)
        b = np.linalg.lstsq(G, c, rcond=1e-9)[0]
        left += float(np.sum((a[fold == i] - z[fold == i] @ b) ** 2))
    return 1.0 - left / max(float(np.sum(a**2)), np.finfo(float).tiny)
