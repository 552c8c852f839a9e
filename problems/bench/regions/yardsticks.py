"""Yardsticks for the widths: the library's other local estimators, and output error."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from workbench.errors import InputError
from workbench.identification import ResponseEstimate, local_polynomial, local_rational
from workbench.types import RealArray

from .design import Case
from .judged import Estimator, Judged, judged_with
from .plants import Channel

WIDTHS = (14, 20, 28, 40, 57, 80, 113, 160)
"""Numbers of lines in a band that are tried."""
POLYNOMIALS, RATIONALS = (1, 2, 4), (1, 2, 3)
"""Degrees that are tried."""
KEEPS, KEEPS_IN_A_THIRD = 0.93, 0.88
"""Least coverage of a setting that counts, over all and in each third of the band."""


def narrowest(
    case: Case, made: tuple[RealArray, RealArray, RealArray], ours: Judged
) -> tuple[float, str]:
    """Median relative radius of the narrowest setting that keeps its coverage, and its name.

    The setting is chosen with knowledge of the truth. The radius is infinite if none keeps its
    coverage.
    """
    best = (np.inf, "none")
    nu = len(case.plant.channels)
    for kind, degrees in (("polynomial", POLYNOMIALS), ("rational", RATIONALS)):
        for degree in degrees:
            unknowns = (degree + 1) * (nu + 1) + (degree if kind == "rational" else 0)
            for width in WIDTHS:
                if not unknowns + 3 < width <= (case.samples - 1) // 2:
                    continue
                estimator = _setting(kind, degree, width, width - unknowns)
                try:
                    found = judged_with(estimator, case, made, ours.frequency, ours.truth)
                except (InputError, np.linalg.LinAlgError):
                    continue
                thirds = [share for share, _ in found.thirds()]
                keeps = np.mean(thirds) >= KEEPS and min(thirds) >= KEEPS_IN_A_THIRD
                if keeps and found.width < best[0]:
                    best = (found.width, f"{kind} of degree {degree} on {width} lines")
    return best


def _setting(kind: str, degree: int, width: int, free: int) -> Estimator:
    """A local estimator of the library with this degree and width of bands."""
    fit = local_polynomial if kind == "polynomial" else local_rational

    def estimate(u: RealArray, y: RealArray, frequency: RealArray) -> ResponseEstimate:
        at = np.round(frequency * len(u)).astype(int)
        found = fit(u, y, degree=degree, lines=width, at=at)
        response = np.nan_to_num(found.response)
        variance = np.where(np.isfinite(found.variance), found.variance, np.inf)
        return ResponseEstimate(frequency, response, variance, 2.0 * free)

    return estimate


def output_error_width(case: Case, u: RealArray, size: float, ours: Judged) -> float:
    """Median relative radius of output error of the true order, from its Cramer-Rao bound.

    It is for one record u (N,) with white noise of this size; NaN for other plants and noise.
    """
    channel = case.plant.channels[0]
    if len(case.plant.channels) > 1 or not isinstance(channel, Channel) or case.colour:
        return np.nan
    above, below = channel.polynomials()
    late = int(channel.delay)
    n = len(below) - 1
    delayed = _delayed(u, late)
    start = np.eye(1, len(u))[0]
    through = {
        "u": lfilter([1.0], below, delayed),
        "y": lfilter(above, np.convolve(below, below), delayed),
        "start": lfilter([1.0], below, start),
    }
    numerators = range(1, len(above))
    slopes = [_delayed(through["u"], k) for k in numerators]
    slopes += [-_delayed(through["y"], k) for k in range(1, n + 1)]
    slopes += [_delayed(through["start"], k) for k in range(n)] + [np.ones(len(u))]
    X = np.stack(slopes, axis=1)
    scale = np.linalg.norm(X, axis=0)
    inverse = np.linalg.pinv(X / scale)
    z = np.exp(2j * np.pi * ours.frequency)
    A, B = np.polyval(below, z) / z**n, np.polyval(above, z) / z ** (len(above) - 1)
    gradient = (
        np.array([z**-k / A for k in numerators] + [-(z**-k) * B / A**2 for k in range(1, n + 1)])
        / z**late
    )
    error = (gradient.T / scale[: len(gradient)]) @ inverse[: len(gradient)]
    radius = size * np.sqrt(np.sum(np.abs(error) ** 2, axis=1) * 2.996)
    return float(np.median((radius / np.abs(ours.truth[:, 0]))[ours.clear]))


def _delayed(x: RealArray, count: int) -> RealArray:
    """A signal delayed by this many samples."""
    return np.concatenate([np.zeros(count), x[: len(x) - count]])
