"""Impulse responses by least squares, with a covariance valid for noise of any colour.

The record is first averaged over blocks, so that a few hundred lags cover any time. Sums over
samples are computed by FFT and corrected at the ends, so that the fit is exactly that of least
squares.

Source: L. Ljung, System Identification, 2nd ed., 1999, sections 4.2 and 9.3 (the covariance of
least squares under coloured noise).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, toeplitz
from scipy.signal import oaconvolve

from workbench._core.arrays import RealArray
from workbench.identification.record_tests.record import RecordData

LAGS = 400
"""Most lags, all inputs together."""
SAMPLES_EACH = 4
"""Fewest samples for each lag."""
DEGREES = 3
"""Largest degree of polynomials of time that are fitted in addition, for drift."""
RIDGE = 1e-9
"""Weight of the regularisation of the lags, relative to the inputs' variance."""
MOST_SAMPLES = 100_000
"""Most samples from which an impulse response is estimated: those in which the inputs move most."""


@dataclass(frozen=True, eq=False)
class Impulse:
    """Impulse responses (nu, lags) of blocks, for one output.

    ``covariance`` (nu lags, nu lags) is that of the responses, ``noise`` is the standard deviation
    of the unexplained output, and ``block`` the number of samples in each block.
    """

    response: RealArray
    covariance: RealArray
    noise: float
    block: int


def gaps_filled(y: RealArray) -> RealArray:
    """A channel (N,) with missing samples interpolated linearly."""
    known = np.isfinite(y)
    if known.all() or not known.any():
        return np.nan_to_num(y)
    at = np.arange(len(y))
    return np.interp(at, at[known], y[known])


def busiest(record: RecordData, most: int = MOST_SAMPLES) -> slice:
    """The part of the longest experiment, with at most ``most`` samples, where inputs move most."""
    longest = max(record.pieces(), key=lambda piece: piece.stop - piece.start)
    if longest.stop - longest.start <= most:
        return longest
    u = record.u[longest]
    size = u.std(axis=0)
    steps = np.diff(u / np.where(size > 0, size, 1.0), axis=0)
    moved = np.concatenate([[0.0], np.cumsum((steps**2).sum(axis=1))])
    first = np.arange(0, len(moved) - most, most // 4)
    start = longest.start + int(first[np.argmax(moved[first + most] - moved[first])])
    return slice(start, start + most)


def blocks(signal: RealArray, size: int) -> RealArray:
    """Means of a signal (N, ...) over blocks of ``size`` samples."""
    count = len(signal) // size
    return signal[: count * size].reshape(count, size, *signal.shape[1:]).mean(axis=1)


def impulse(u: RealArray, y: RealArray, block: int = 1) -> Impulse | None:
    """Impulse responses from inputs (N, nu) to an output (N,); None if too short."""
    if block > 1:
        u, y = blocks(u, block), blocks(y, block)
    (count, nu), lags = u.shape, min(LAGS // u.shape[1], len(u) // (SAMPLES_EACH * u.shape[1]))
    if lags < 4:
        return None
    u, y = u - u.mean(axis=0), y - y.mean()
    u_size, y_size = u.std(axis=0), float(y.std())
    if not (y_size > 0 and u_size.any()):
        return None
    # an input at rest explains nothing: the ridge makes its response zero
    u_size[u_size == 0] = 1.0
    u, y = u / u_size, y / y_size
    rows = count - lags + 1
    trend = np.linalg.qr(np.polynomial.legendre.legvander(np.linspace(-1, 1, rows), DEGREES))[0]
    matrix, target = _normal_equations(u, y, lags, trend)
    matrix[np.diag_indices_from(matrix)] += RIDGE * rows
    factor = cho_factor(matrix)
    response = cho_solve(factor, target).reshape(nu, lags)
    made = sum(oaconvolve(u[:, j], response[j])[lags - 1 : count] for j in range(nu))
    left = y[lags - 1 :] - made
    left = left - trend @ (trend.T @ left)
    inverse = cho_solve(factor, np.eye(len(matrix)))
    # The lags use up degrees of freedom of the noise.
    free = rows / max(rows - nu * lags, 1)
    middle = _noise_part(u[lags - 1 :], left, lags) * free
    # Directions that the inputs leave undetermined get the uncertainty of a response as large as
    # the output.
    covariance = inverse @ middle @ inverse + RIDGE * rows * inverse
    scale = y_size / np.repeat(u_size, lags)
    return Impulse(
        response * y_size / u_size[:, None],
        covariance * np.outer(scale, scale),
        float(np.sqrt(np.mean(left**2) * free)) * y_size,
        block,
    )


def _normal_equations(
    u: RealArray, y: RealArray, lags: int, trend: RealArray
) -> tuple[RealArray, RealArray]:
    """Matrix (nu lags, nu lags) and right side of the fit of y_t to u_(t - l).

    Orthonormal trends (rows, K) are fitted in addition, and eliminated.
    """
    count, nu = u.shape
    start = lags - 1
    size = 1 << int(np.ceil(np.log2(2 * count)))
    late = u.copy()
    late[:start] = 0.0
    whole = np.fft.rfft(u, size, axis=0)
    of_late = np.fft.rfft(late, size, axis=0)
    beside = np.zeros((count, 1 + trend.shape[1]))
    beside[start:] = np.column_stack([y[start:], trend])
    of_beside = np.fft.rfft(beside, size, axis=0)
    matrix, sums = np.empty((nu, lags, nu, lags)), np.empty((nu, lags, beside.shape[1]))
    first, last = u[start - 1 :: -1][: lags - 1], u[count - 1 : count - lags : -1]
    for i in range(nu):
        sums[i] = np.fft.irfft(whole[:, i, None].conj() * of_beside, size, axis=0)[:lags]
        for j in range(nu):
            # Sums of u_i,(t - 0) u_j,(t - l) and of u_i,(t - l) u_j,(t - 0); the others follow.
            across = np.fft.irfft(whole[:, j].conj() * of_late[:, i], size)[:lags]
            down = np.fft.irfft(whole[:, i].conj() * of_late[:, j], size)[:lags]
            part = np.empty((lags, lags))
            part[0], part[:, 0] = across, down
            change = np.outer(first[:, i], first[:, j]) - np.outer(last[:, i], last[:, j])
            for k in range(1, lags):
                part[k, 1:] = part[k - 1, :-1] + change[k - 1]
            matrix[i, :, j] = part
    flat = sums.reshape(nu * lags, -1)
    target, slow = flat[:, 0], flat[:, 1:]
    return (
        matrix.reshape(nu * lags, nu * lags) - slow @ slow.T,
        target - slow @ (trend.T @ y[start:]),
    )


def _noise_part(u: RealArray, left: RealArray, lags: int) -> RealArray:
    """Covariance (nu lags, nu lags) of the sums of u_(t - l) v_t, for noise v of any colour."""
    size = 1 << int(np.ceil(np.log2(2 * len(u))))
    colour = np.fft.irfft(np.abs(np.fft.rfft(left, size)) ** 2, size)
    # Beyond a few hundred lags there is nothing but chance.
    window = np.zeros(size)
    reach = min(len(left) // 4, lags)
    window[: reach + 1] = 1 - np.arange(reach + 1) / (reach + 1)
    window[-reach:] = window[1 : reach + 1][::-1]
    power = np.maximum(np.fft.rfft(colour * window).real, 0.0) / len(u)
    spectra = np.fft.rfft(u, size, axis=0)
    nu = u.shape[1]
    found = np.empty((nu, lags, nu, lags))
    for i in range(nu):
        for j in range(nu):
            shared = np.fft.irfft(power * spectra[:, i].conj() * spectra[:, j], size)
            found[i, :, j] = toeplitz(shared[:lags], np.r_[shared[0], shared[-1:-lags:-1]])
    return found.reshape(nu * lags, nu * lags)
