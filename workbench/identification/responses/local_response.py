"""Response from one arbitrary record: local models of several kinds and widths, averaged.

Near each frequency the record is fitted by polynomials and by rational functions, in bands from
narrow to wide. A fit is dropped if its residuals are explained by a larger model in the same band,
or by a model in the band of half the width, at the lines of that band. The bias of a remaining fit
is estimated by its distance from those of larger variance, beyond the distance that noise explains.
In the average, fits with smaller expected errors have more weight. The variance includes the
distance between the fits, so that a region is wide where they disagree.

Sources: A. Goldenshluger, O. Lepski, "Bandwidth selection in kernel density estimation: oracle
inequalities and adaptive minimax optimality", Annals of Statistics 39(3), 2011 (bias by
comparison); S. T. Buckland, K. P. Burnham, N. H. Augustin, "Model selection: an integral part of
inference", Biometrics 53(2), 1997 (variance of an average of models).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from workbench._core.arrays import BoolArray, ComplexArray, IntegerArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.quality import checked_record
from workbench.identification.experiments.reports import report_of_arrays
from workbench.identification.responses.bands import BandFits, fitted_bands, unknowns
from workbench.identification.responses.local_polynomial import spectrum
from workbench.identification.responses.periodic import ResponseEstimate
from workbench.input_checks import need_positive

MODELS = ((2, 0), (2, 1), (2, 2), (4, 4))
"""Degrees of numerators and of denominators; each kind contains the one before."""
LINES_FOR_EACH, DOUBLINGS = 10, 4
"""Number of lines of the narrowest band for each input and for the transient; number of widths,
each twice the last.
"""
SPARE_LINES = 6
"""Fewest lines in a band minus the number of unknowns."""
DEGREES = 40.0
"""Degrees of freedom that are assigned to the variance of an average."""
CHANCE = 1e-4
"""Probability with which noise alone makes one larger or local fit reject another."""
BIAS_WEIGHT = 0.5
"""Weight of a fit's squared bias relative to its variance: the bias is itself uncertain."""
SHARPNESS = 1.5
"""A fit's weight in the average is its expected squared error to the power of minus this."""
MIRRORED = float(stats.chi2.ppf(0.95, 1) / stats.chi2.ppf(0.95, 2) * 2.0)
"""Factor of the variance in a band about frequency 0: errors are real there, and a real error
leaves a disc more often than a complex one of the same variance.
"""
RESPONSE_ROUNDING = 1e-9
"""Relative error of a response that rounding may cause."""
TINY = float(np.finfo(float).tiny)
"""Least sum of squared residuals that is used as a divisor."""
MOST_LINES = 200
"""Most frequencies, if none are given."""
LINES_AT_ONCE = 256
"""Number of frequencies whose bands are in memory at once."""


Places = TypeVar("Places", RealArray, IntegerArray)


def local_response(
    u: ArrayLike,
    y: ArrayLike,
    dt: float,
    *,
    frequency_hz: ArrayLike | None = None,
    assume: str | Sequence[str] = (),
) -> ResponseEstimate:
    """Response from inputs u (N, nu) to outputs y (N, ny), with regions for bias and noise.

    A single channel may be given as (N,).

    The loop must be open; for a plant in a closed loop use `driven_response`.

    Parameters
    ----------
    dt
        Sampling time [s].
    frequency_hz
        Frequencies (F,) [Hz], rising, from one period per record to half the sampling frequency;
        they need not be lines of the record. None: at most 200 lines, equally spaced in log
        frequency.
    assume
        Assumptions about the record that you vouch for although its `record_report` rejects them.

    Returns
    -------
    ResponseEstimate
        Its variance is infinite at frequencies without information, where an input excites too few
        lines.

    Raises
    ------
    InputError
        The same as for `checked_record`; the record is too short, or a finding forbids its use; or
        the frequencies are invalid.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import local_response
    >>> u, noise = np.random.default_rng(0).standard_normal((2, 1000))
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> y = y + 0.01 * noise
    >>> found = local_response(u[:, None], y[:, None], 1.0, frequency_hz=[0.1, 0.2])
    >>> exact = 0.5 / (np.exp(1j * found.omega) - 0.5)
    >>> bool((abs(found.response[:, 0, 0] - exact) <= found.radius(confidence=0.95)[:, 0, 0]).all())
    True
    """
    need_positive(dt, "dt")
    u, y = checked_record(u, y)
    report = report_of_arrays(u, y, assume, dt)
    return replace(averaged_models(u, y, dt, frequency_hz=frequency_hz), report=report)


def averaged_models(
    u: ArrayLike, y: ArrayLike, dt: float, *, frequency_hz: ArrayLike | None = None
) -> ResponseEstimate:
    """As `local_response`, for a record that has been checked."""
    u, y = checked_record(u, y)
    samples, nu = u.shape
    last = (samples - 1) // 2
    needed = unknowns(nu, *MODELS[0]) + SPARE_LINES
    if last < needed:
        raise InputError(
            f"{samples} samples have {last} lines beside their mean; {needed} are needed for {nu} "
            f"inputs: take a record of {2 * needed + 1} samples or more"
        )
    if frequency_hz is None:
        places = np.asarray(spaced_in_log(np.arange(1.0, last + 1), MOST_LINES))
    else:
        places = _places(frequency_hz, samples * dt, last)
    U, Y = spectrum(u), spectrum(y)
    response = np.empty((places.size, y.shape[1], nu), complex)
    variance = np.empty(response.shape)
    for start in range(0, places.size, LINES_AT_ONCE):
        part = slice(start, start + LINES_AT_ONCE)
        for output, values in enumerate(Y.T):
            bands = _candidates(U, values, samples, places[part])
            response[part, output], variance[part, output] = _average(bands)
    return ResponseEstimate(places / (samples * dt), response, variance, DEGREES)


def spaced_in_log(places: Places, most: int) -> Places:
    """At most ``most`` of the rising places, equally spaced in their logarithms if possible."""
    if places.size <= most:
        return places
    log = np.log(places)
    wanted = np.linspace(log[0], log[-1], most)
    nearest = np.clip(np.searchsorted(log, wanted), 1, len(log) - 1)
    nearest -= wanted - log[nearest - 1] < log[nearest] - wanted
    return places[np.unique(nearest)]


def _places(frequency_hz: ArrayLike, duration: float, last: int) -> RealArray:
    """Places among the lines of a record; raises InputError for invalid frequencies."""
    try:
        places = np.asarray(frequency_hz, dtype=float) * duration
    except (TypeError, ValueError):
        places = np.empty(0)
    slack = 1e-9 * last
    if (
        places.ndim != 1
        or not places.size
        or not np.isfinite(places).all()
        or (np.diff(places) <= 0).any()
        or places[0] < 1 - slack
        or places[-1] > last + slack
    ):
        raise InputError(
            f"frequency_hz must be rising numbers (F,) from {1 / duration:.6g} to "
            f"{last / duration:.6g} Hz, which this record has, not {frequency_hz!r:.60}"
        )
    return places


def _candidates(
    U: ComplexArray, y: ComplexArray, samples: int, places: RealArray
) -> list[BandFits]:
    """Fits of all kinds and widths for which the record has enough lines."""
    nu, last = U.shape[1], (samples - 1) // 2
    widths = [LINES_FOR_EACH * (nu + 1) * 2**k for k in range(DOUBLINGS)]
    found: list[BandFits] = []
    narrower: list[BandFits] = []
    for width in [width for width in widths if width <= last] or [last]:
        models = [one for one in MODELS if unknowns(nu, *one) + SPARE_LINES <= width]
        fits = fitted_bands(U, y, samples, places, width, models)
        found += _reject_misfits(fits, narrower)
        narrower = fits
    return found


def _reject_misfits(nested: list[BandFits], narrower: list[BandFits]) -> list[BandFits]:
    """Nested fits of one band; rejected ones get infinite variance.

    A fit is rejected if its residuals favour a larger one of the same band or, at the lines of the
    narrower band, one that is not smaller: so the largest fit of a band that is too wide is
    rejected, too. A larger fit whose coefficients are undetermined does not count: without noise
    the largest fit always has smaller residuals, by coefficients that nothing determines.

    A fit gets at least the variance of a smaller accepted one, for the same noise. To linear order,
    a pole beside a line, which follows that line's noise, seems more accurate than it is.
    """
    found: list[BandFits] = []
    for k, fit in enumerate(nested):
        rejected = np.zeros(len(fit.free), bool)
        for large in nested[k + 1 :]:
            rejected |= _explains(large, fit.left, large.unknowns - fit.unknowns)
        for local in narrower[k:]:
            rejected |= _explains(local, fit.left_within(local), local.unknowns)
        least = np.zeros(fit.variance.shape)
        for small in found:
            noise = fit.left * small.free / np.maximum(small.left * fit.free, TINY)
            least = np.maximum(
                least, np.where(np.isfinite(small.variance), small.variance * noise[:, None], 0.0)
            )
        variance = np.where(rejected[:, None], np.inf, np.maximum(fit.variance, least))
        found.append(replace(fit, variance=variance))
    return found


def _explains(fit: BandFits, left: RealArray, more: RealArray) -> BoolArray:
    """Mask (F,) of places where a fit with so many more unknowns explains another's residuals.

    ``left`` (F,): sum of the other's squared residuals at the lines of this fit. An F test.
    """
    limit = stats.f.isf(CHANCE, 2 * more, 2 * fit.free)
    less: BoolArray = (left - fit.left) * fit.free > limit * more * fit.left
    return less & np.isfinite(fit.variance).all(axis=1)


def _average(bands: list[BandFits]) -> tuple[ComplexArray, RealArray]:
    """Average (F, nu) of fits, and its variance; infinite if no fit has information."""
    variance = np.array([_variance_of_same_radius(one) for one in bands])
    told = np.isfinite(variance)
    response: ComplexArray = np.where(told, [one.response for one in bands], 0j)
    known = told.any(axis=0)
    scale = np.where(known, np.where(told, variance, np.inf).min(axis=0), 1.0)
    size = np.where(told, variance / scale, np.inf)
    response /= np.sqrt(scale)
    weight = (size + BIAS_WEIGHT * _squared_bias(response, size, told)) ** -SHARPNESS
    weight /= np.where(known, weight.sum(axis=0), 1.0)
    mean = (weight * response).sum(axis=0)
    spread = np.where(told, size, 0.0) + np.abs(response - mean) ** 2
    total = (weight * spread).sum(axis=0)
    return mean * np.sqrt(scale), np.where(known, total * scale, np.inf)


def _variance_of_same_radius(band: BandFits) -> RealArray:
    """Variances (F, nu) with the same 95 % radius at the degrees of freedom of an average."""
    factor = stats.f.ppf(0.95, 2, 2 * band.free) / stats.f.ppf(0.95, 2, DEGREES)
    factor *= 1.0 + (MIRRORED - 1.0) * band.mirrored
    floor = (RESPONSE_ROUNDING * np.abs(band.response)) ** 2
    variance: RealArray = np.maximum(factor[:, None] * band.variance, floor)
    return variance


def _squared_bias(response: ComplexArray, variance: RealArray, told: BoolArray) -> RealArray:
    """Squared bias (C, F, nu) of each fit, by comparison with fits of larger variance.

    Apart from noise, the difference between two fits of one record is the bias of the one with less
    variance. The variance of the noise part is the difference of their variances, if the better fit
    is efficient.
    """
    found = np.zeros(variance.shape)
    for k, (value, own) in enumerate(zip(response, variance, strict=True)):
        larger = told & (variance > own)
        share = np.where(larger, 1.0 / variance, 0.0)
        noise = np.where(larger, variance, 0.0) - np.where(larger, own, 0.0)
        beyond = np.abs(response - value) ** 2 - noise
        total = share.sum(axis=0)
        found[k] = (share * beyond).sum(axis=0) / np.where(total > 0, total, 1.0)
    return np.maximum(found, 0.0)
