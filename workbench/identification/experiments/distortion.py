"""Measures of nonlinear distortion: harmonics of a sine, and silent lines of an odd multisine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from workbench._core.arrays import ComplexArray, RealArray
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

    Examples
    --------
    >>> from workbench.identification import total_harmonic_distortion
    >>> float(total_harmonic_distortion([10.0, 0.3, 0.4]))
    0.05
    """
    sizes = np.abs(np.asarray(amplitudes))
    if sizes.ndim == 0 or sizes.shape[-1] < 2:
        raise InputError("a fundamental and one harmonic or more are needed")
    if np.any(sizes[..., 0] == 0):
        raise InputError("the fundamental is zero: the channel is dead or the frequency wrong")
    return np.sqrt(np.sum(sizes[..., 1:] ** 2, axis=-1)) / sizes[..., 0]


@dataclass(frozen=True)
class LineDistortion:
    """Nonlinear distortion at the silent lines of an odd multisine, or at harmonics of sines.

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
    odd_square, even_square
        Mean squares at these lines minus the noise's share. They are unbiased, so with noise alone
        they are negative about as often as positive. ``odd`` and ``even`` are their roots, or 0.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import line_amplitudes, line_distortion
    >>> time = np.arange(4 * 64) / 64
    >>> u = np.cos(2 * np.pi * time) + np.cos(2 * np.pi * 7 * time + 1.0)
    >>> noise = 1e-3 * np.random.default_rng(0).standard_normal(len(time))
    >>> found = line_distortion(line_amplitudes(u + 0.1 * u**3 + noise, 64), excited=[1, 7])
    >>> found.detected(), bool(found.odd > 10 * found.even)
    (True, True)
    """

    odd: float
    even: float
    noise: float
    excited: float
    odd_p: float
    even_p: float
    odd_square: float
    even_square: float

    def detected(self, *, level: float = 0.01) -> bool:
        """Whether distortion is significant at this level, which odd and even lines share."""
        return min(self.odd_p, self.even_p) < level / 2


def line_distortion(
    amplitudes: ArrayLike, excited: ArrayLike, *, transients: int = 0
) -> LineDistortion:
    """Odd and even nonlinear distortion from the silent lines of an odd multisine.

    A linear system responds at excited lines only; an even nonlinearity appears at even lines, an
    odd one at silent odd lines (Pintelon and Schoukens, section 4.3). Repeated periods separate
    distortion from noise: with noise alone, the ratio of |mean|^2 to S^2 / M at a line has the
    distribution F(2, 2 (M - 1)), whatever the colour of the noise; Fisher's rule joins the lines.

    Parameters
    ----------
    amplitudes
        Complex amplitudes of one channel, shape (periods, lines), as `line_amplitudes` gives.
    excited
        The odd lines of the multisine. The lines between the first and the last are examined.
    transients
        Number of leading periods to discard.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import line_amplitudes, line_distortion
    >>> time = np.arange(4 * 64) / 64
    >>> u = np.cos(2 * np.pi * time) + np.cos(2 * np.pi * 7 * time + 1.0)
    >>> noise = 1e-3 * np.random.default_rng(0).standard_normal(len(time))
    >>> found = line_distortion(line_amplitudes(u + 0.1 * u**2 + noise, 64), excited=[1, 7])
    >>> bool(found.even > 10 * found.odd), found.even_p < 0.01
    (True, True)
    """
    periods = np.asarray(amplitudes, dtype=complex)
    lines = np.asarray(excited)
    if periods.ndim != 2:
        raise InputError(f"amplitudes have shape {periods.shape}; (periods, lines) is needed")
    if np.any(lines % 2 == 0) or lines.max() >= periods.shape[1]:
        raise InputError("excited lines must be odd and below the number of lines measured")
    silent = np.setdiff1d(np.arange(lines.min(), lines.max() + 1), lines)
    for name, remainder in (("odd", 1), ("even", 0)):
        if not np.any(silent % 2 == remainder):
            raise InputError(f"the multisine leaves no {name} line silent: choose by `odd_lines`")
    odd, even = (periods[:, silent[silent % 2 == remainder]] for remainder in (1, 0))
    parts = [_without_transients(one, transients, 2) for one in (periods[:, lines], odd, even)]
    noises = [one.var(axis=0, ddof=1) / len(one) for one in parts[1:]]
    return distortion_of_lines([one.mean(axis=0) for one in parts], noises, 2 * (len(parts[0]) - 1))


def harmonic_distortion(amplitudes: ArrayLike, *, transients: int = 0) -> LineDistortion:
    """Odd and even distortion from the harmonics of sines at F frequencies, pooled.

    A single period hardly separates a harmonic from its neighbours. So the scatter of the periods
    gives the variance of their mean only for white noise. The noise is taken instead from the two
    lines nearest to each harmonic that all M periods together resolve, at f (1 +- 1 / M).

    Parameters
    ----------
    amplitudes
        Complex amplitudes, shape (F, periods, harmonics), the fundamental first, as `sine_fit`
        gives; three harmonics or more, and three periods or more.
    transients
        Number of leading periods at each frequency to discard.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import harmonic_distortion, sine_fit
    >>> time = np.arange(5 * 64) / 64
    >>> u = np.cos(2 * np.pi * time) + 1e-3 * np.random.default_rng(0).standard_normal(len(time))
    >>> amplitudes = sine_fit(u + 0.1 * u**3, 1 / 64.0, 1.0, harmonics=3)
    >>> round(float(harmonic_distortion(amplitudes[None]).odd), 3)  # of 0.1 cos(t)^3
    0.025
    """
    every = np.asarray(amplitudes, dtype=complex)
    if every.ndim != 3 or every.shape[2] < 3:
        raise InputError(
            f"amplitudes have shape {every.shape}; (frequencies, periods, harmonics) is needed, "
            "with three harmonics or more"
        )
    periods = _without_transients(np.moveaxis(every, 1, 0), transients, 3)
    lines = np.fft.fft(periods, axis=0) / len(periods)
    noise = np.mean(np.abs(lines[[1, -1]]) ** 2, axis=0)
    kinds = slice(2, None, 2), slice(1, None, 2)
    means = [lines[0][:, :1], *(lines[0][:, one] for one in kinds)]
    noises = [noise[:, one].ravel() for one in kinds]
    return distortion_of_lines([one.ravel() for one in means], noises, 4)


def _without_transients(periods: ComplexArray, transients: int, least: int) -> ComplexArray:
    """The periods after the transients; raises `InputError` if there are too few."""
    kept = periods[transients:]
    if len(kept) < least:
        raise InputError(
            f"{'two' if least == 2 else 'three'} periods or more are needed to tell distortion "
            f"from noise, not {len(kept)}"
        )
    return kept


def distortion_of_lines(
    means: Sequence[ComplexArray], noises: Sequence[RealArray], degrees: int
) -> LineDistortion:
    """Distortion from mean amplitudes at excited, odd and even lines, and their variances.

    The variances are those of odd and even lines; they have ``degrees`` degrees of freedom per
    line.
    """
    found = []
    for mean, noise in zip(means[1:], noises, strict=True):
        power = np.abs(mean) ** 2
        ratio = np.divide(power, noise, out=np.where(power > 0, np.inf, 0.0), where=noise > 0)
        logarithms = stats.f.logsf(ratio, 2, degrees)
        p = float(stats.chi2.sf(-2 * np.sum(logarithms), 2 * len(power)))
        found.append((float(np.mean(power - noise)), p))
    (odd, odd_p), (even, even_p) = found
    return LineDistortion(
        odd=float(np.sqrt(max(odd, 0.0))),
        even=float(np.sqrt(max(even, 0.0))),
        noise=float(np.sqrt(np.mean(np.concatenate(noises)))),
        excited=float(np.sqrt(np.mean(np.abs(means[0]) ** 2))),
        odd_p=odd_p,
        even_p=even_p,
        odd_square=odd,
        even_square=even,
    )
