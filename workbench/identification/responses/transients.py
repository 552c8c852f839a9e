"""The transient of a periodic record, fitted between its excited lines and subtracted.

Polynomials follow functions that are smooth over a band. The transient of a mode that outlives the
record is a pole narrower than the band. There a rational function is fitted to the output error,
and used if it explains so much more than the polynomial that noise alone is unlikely to cause this.

Source: R. Pintelon, J. Schoukens, G. Vandersteen and K. Barbe, Mechanical Systems and Signal
Processing 24, 2010, part II; T. McKelvey and G. Guérin, Non-parametric frequency response
estimation using a local rational model, 16th IFAC Symposium on System Identification, 2012.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import f as f_distribution

from workbench._core.arrays import ComplexArray, IntegerArray, RealArray
from workbench.errors import InputError

LEAST_SPARE = 3
"""Fewest lines minus unknowns in a band that is cut at an end of the spectrum."""
CHANCE = 1e-3
"""Probability with which residuals of pure noise are taken for those of a pole."""
REWEIGHTED, STEPS = 3, 4
"""Number of reweighted linear fits, and of Gauss-Newton steps after them."""


def without_transient(
    spectra: ComplexArray,
    offsets: IntegerArray,
    centres: IntegerArray,
    periods: int,
    samples: int,
    degree: int,
    *,
    rational: bool,
) -> tuple[ComplexArray, ComplexArray, int]:
    """Amplitudes without transient, the covariance of their errors, and spare lines of a band.

    Parameters
    ----------
    spectra
        (K, offsets, channels, experiments) about the lines ``centres`` (K,).
    rational
        Whether transients may be rational functions with numerator and denominator of this degree.

    Returns
    -------
    tuple
        Amplitudes (K, channels, experiments); covariance (K, channels, channels) of their errors in
        one experiment; and the least number of lines minus unknowns in a band.

    Raises
    ------
    InputError
        A band has too few lines for its unknowns.
    """
    inside = (centres[:, None] + offsets >= 1) & (centres[:, None] + offsets < samples / 2)
    usable = inside & (offsets % periods != 0)
    count, channels, experiments = len(centres), spectra.shape[2], spectra.shape[3]
    clean = np.empty((count, channels, experiments), complex)
    spread = np.empty((count, channels, channels), complex)
    middle, least = offsets.size // 2, offsets.size
    unknowns = 2 * degree + 1 if rational else degree + 1
    patterns, which = np.unique(usable, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        rows = np.flatnonzero(which.ravel() == number)
        spare = int(pattern.sum()) - unknowns
        if spare < LEAST_SPARE:
            raise InputError(
                f"the band about line {centres[rows[0]]} of {samples} samples has {pattern.sum()} "
                f"lines for degree {degree}: take more periods, a lower degree, or higher lines"
            )
        least = min(least, spare)
        powers = (offsets[pattern, None] / offsets[-1]) ** np.arange(degree + 1)
        band = np.moveaxis(spectra[rows][:, pattern], 1, -1)  # (K, channels, experiments, lines)
        transient, left, ahead, free = _by_polynomials(band, powers)
        if rational:
            pole = _by_rational_functions(band, powers, (transient, left, ahead, free))
            transient, left, ahead, free = pole
        clean[rows] = spectra[rows, middle] - transient
        left = left / np.sqrt(free)[..., None]
        noise = np.einsum("kcer,kder->kcd", left, left.conj()) / experiments
        shared = np.einsum("kcer,kder->kcd", ahead, ahead.conj()) / experiments
        spread[rows] = noise * (1.0 + shared)
    return clean, spread, least


Fit = tuple[ComplexArray, ComplexArray, ComplexArray, RealArray]
"""For each record of a band: the transient at its middle, the residuals at its lines, the weights
with which noise at these lines enters the transient, and the lines minus unknowns.
"""


def _by_polynomials(band: ComplexArray, powers: RealArray) -> Fit:
    Q, R = np.linalg.qr(powers)
    ahead = np.linalg.solve(R.T, np.eye(powers.shape[1])[0]) @ Q.T  # value of the fit at offset 0
    left = band - band @ (Q @ Q.T)
    free = np.full(band.shape[:-1], float(powers.shape[0] - powers.shape[1]))
    return band @ ahead, left, np.broadcast_to(ahead.astype(complex), band.shape), free


def _by_rational_functions(band: ComplexArray, powers: RealArray, smooth: Fit) -> Fit:
    """Rational fits if the polynomials' residuals indicate a pole, otherwise the polynomials."""
    degree = powers.shape[1] - 1
    size = np.linalg.norm(band, axis=-1, keepdims=True)
    values = band / np.where(size > 0, size, 1.0)
    weights = np.ones_like(values)
    for _ in range(REWEIGHTED):
        own = -values[..., None] * powers[:, 1:]
        regressors = np.concatenate([np.broadcast_to(powers, (*band.shape, degree + 1)), own], -1)
        theta = _solved(regressors * weights[..., None], values * weights)
        weights = 1.0 / _denominator(theta, powers)
    left, slopes = _residuals(theta, values, powers)
    square = np.sum(np.abs(left) ** 2, axis=-1)
    for _ in range(STEPS):
        moved = theta + _solved(slopes, left)
        tried, steeper = _residuals(moved, values, powers)
        lower = np.sum(np.abs(tried) ** 2, axis=-1) < square
        theta = np.where(lower[..., None], moved, theta)
        left = np.where(lower[..., None], tried, left)
        slopes = np.where(lower[..., None, None], steeper, slopes)
        square = np.sum(np.abs(left) ** 2, axis=-1)
    ahead = np.linalg.pinv(slopes)[..., 0, :]
    left = left * size
    free = np.full(band.shape[:-1], float(powers.shape[0] - 2 * degree - 1))
    before, after = (np.sum(np.abs(x) ** 2, axis=-1) for x in (smooth[1], left))
    limit = f_distribution.isf(CHANCE, 2 * degree, 2 * free)
    # A pole very close to the middle would be followed, but its size there is determined by noise
    # only.
    sizes = (1.0 + np.sum(np.abs(x) ** 2, axis=-1) for x in (smooth[2], ahead))
    errors = [s * x / n for s, x, n in zip(sizes, (before, after), (smooth[3], free), strict=True)]
    pole = (before - after > limit * degree * after / free) & (errors[1] < errors[0])
    return (
        np.where(pole, theta[..., 0] * size[..., 0], smooth[0]),
        np.where(pole[..., None], left, smooth[1]),
        np.where(pole[..., None], ahead, smooth[2]),
        np.where(pole, free, smooth[3]),
    )


def _solved(regressors: ComplexArray, values: ComplexArray) -> ComplexArray:
    """Least squares with columns scaled first."""
    scale = np.linalg.norm(regressors, axis=-2, keepdims=True)
    scale = np.where(scale > 0, scale, 1.0)
    found = np.linalg.pinv(regressors / scale) @ values[..., None]
    result: ComplexArray = found[..., 0] / scale[..., 0, :]
    return result


def _denominator(theta: ComplexArray, powers: RealArray) -> ComplexArray:
    """Values of the denominator; a root at a line is moved away from it."""
    degree = powers.shape[1] - 1
    below = 1.0 + theta[..., degree + 1 :] @ powers[:, 1:].T
    tiny = np.sqrt(np.finfo(float).eps)
    result: ComplexArray = np.where(np.abs(below) < tiny, tiny, below)
    return result


def _residuals(
    theta: ComplexArray, values: ComplexArray, powers: RealArray
) -> tuple[ComplexArray, ComplexArray]:
    """Output errors at the lines, and derivatives of the model with respect to its coefficients."""
    below = _denominator(theta, powers)
    model = theta[..., : powers.shape[1]] @ powers.T / below
    slopes = np.concatenate(
        [powers / below[..., None], -powers[:, 1:] * (model / below)[..., None]], axis=-1
    )
    return values - model, slopes
