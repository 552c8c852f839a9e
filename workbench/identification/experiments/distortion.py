"""Measures of nonlinear distortion: harmonics of a sine, and silent lines of an odd multisine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from workbench.errors import InputError


def total_harmonic_distortion(amplitudes: ArrayLike) -> np.ndarray:
    """Ratio of the root sum of squares of the harmonics to the fundamental (equation 4.26).

    Parameters
    ----------
    amplitudes
        Complex amplitudes or magnitudes, shape (..., harmonics), the fundamental first, as
        `sine_fit` gives. Average the periods first, because noise would count as distortion.

    Returns
    -------
    ndarray
        Ratios of shape (...); multiply by 100 for percent.
    """
    sizes = np.abs(np.asarray(amplitudes))
    if sizes.ndim == 0 or sizes.shape[-1] < 2:
        raise InputError("a fundamental and one harmonic or more are needed")
    if np.any(sizes[..., 0] == 0):
        raise InputError("the fundamental is zero: the channel is dead or the frequency wrong")
    return np.sqrt(np.sum(sizes[..., 1:] ** 2, axis=-1)) / sizes[..., 0]


@dataclass(frozen=True)
class LineDistortion:
    """Nonlinear distortion at the silent lines of an odd multisine.

    Parameters
    ----------
    odd, even
        Root-mean-square amplitude at silent odd lines and at even lines, without the noise's share.
    noise
        Root-mean-square amplitude that noise alone causes in the averaged lines.
    excited
        Root-mean-square amplitude at excited lines.
    odd_p, even_p
        p-values of the hypothesis that these lines contain only noise.
    """

    odd: float
    even: float
    noise: float
    excited: float
    odd_p: float
    even_p: float

    def detected(self, level: float = 0.01) -> bool:
        """Whether distortion is significant at this level, shared between odd and even lines."""
        return min(self.odd_p, self.even_p) < level / 2


def line_distortion(
    amplitudes: ArrayLike, excited: ArrayLike, *, transients: int = 0
) -> LineDistortion:
    """Odd and even nonlinear distortion from the silent lines of an odd multisine.

    A linear system responds at excited lines only; an even nonlinearity appears at even lines, an
    odd one at silent odd lines (Pintelon and Schoukens, section 4.3). Repeated periods separate
    distortion from noise: with noise alone, the ratio of sum |mean|^2 to sum S^2 / M over L lines
    has the distribution F(2 L, 2 L (M - 1)).

    Parameters
    ----------
    amplitudes
        Complex amplitudes of one channel, shape (periods, lines), as `line_amplitudes` gives.
    excited
        The odd lines of the multisine. The lines between the first and the last are examined.
    transients
        Number of leading periods to discard.
    """
    periods = np.asarray(amplitudes, dtype=complex)[transients:]
    lines = np.asarray(excited)
    if periods.ndim != 2 or len(periods) < 2:
        raise InputError("two periods or more are needed to tell distortion from noise")
    if np.any(lines % 2 == 0) or lines.max() >= periods.shape[1]:
        raise InputError("excited lines must be odd and below the number of lines measured")
    silent = np.setdiff1d(np.arange(lines.min(), lines.max() + 1), lines)
    mean, noise = periods.mean(axis=0), periods.var(axis=0, ddof=1) / len(periods)
    found = {}
    for name, chosen in (("odd", silent[silent % 2 == 1]), ("even", silent[silent % 2 == 0])):
        if not len(chosen):
            raise InputError(f"the multisine leaves no {name} line silent: choose by `odd_lines`")
        power, floor = np.sum(np.abs(mean[chosen]) ** 2), np.sum(noise[chosen])
        count = 2 * len(chosen)
        ratio = power / floor if floor > 0 else np.inf if power > 0 else 0.0
        p = float(stats.f.sf(ratio, count, count * (len(periods) - 1)))
        found[name] = (float(np.sqrt(max(power - floor, 0) / len(chosen))), p)
    return LineDistortion(
        odd=found["odd"][0],
        even=found["even"][0],
        noise=float(np.sqrt(np.mean(noise[silent]))),
        excited=float(np.sqrt(np.mean(np.abs(mean[lines]) ** 2))),
        odd_p=found["odd"][1],
        even_p=found["even"][1],
    )
