"""Responses of several plants from their records, with variances, at common frequencies.

If the inputs have many periods, whole periods are averaged (`periodic_response`); other records are
estimated by local models (`local_response`). A report says what was done.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from workbench._core.arrays import BoolArray, IntegerArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.quality import checked_record
from workbench.identification.record_tests.periods import period
from workbench.identification.responses.dry_friction import (
    DryFriction,
    dry_friction,
    is_certain,
)
from workbench.identification.responses.local_response import averaged_models, spaced_in_log
from workbench.identification.responses.periodic import (
    PeriodicResponse,
    ResponseEstimate,
    periodic_response,
)
from workbench.identification.responses.repeated_rounding import (
    FEWEST_LEVELS,
    repeated_rounding,
)
from workbench.identification.responses.silent_lines import with_neighbours

EXCITED = 1e-3
"""Least amplitude of an excited line, relative to the largest."""
OF_NEIGHBOURS, PER_OCTAVE = 0.03, 4
"""Least amplitude of an excited line, relative to the largest within half an octave; and number of
bands per octave in which that is searched. Weaker lines are distortions of a loop and rounding of a
converter: they repeat in every period as the excitation does, and hardly move the plant.
"""
EXCITED_OVER_NOISE = 5.0
"""Least ratio of an excited line's amplitude to the standard deviation of its mean."""
SETTLED = 2.0
"""The first period counts as settled if its distance from the later ones, relative to theirs, is at
most this.
"""
MANY_PERIODS = 6
"""Number of periods whose scatter alone determines the noise well enough."""
DENSE = 2
"""If neighbouring excited lines are at most so far apart, bands of lines show the response between
them.
"""
LARGER_BY_FAR = 30.0
"""A region says nothing about a plant if its radius, relative to the largest certain response,
exceeds this.
"""
NAMED = 4
"""Most frequencies that a sentence lists."""
TOLD = 0.95
"""Confidence of the regions that decide which frequencies are left out."""
FEWEST_SAMPLES = 29
"""Fewest samples of a record from which a response is estimated."""


def record_responses(
    records: Sequence[tuple[RealArray, RealArray]], sample_rate: float, most: int
) -> tuple[list[ResponseEstimate], str]:
    """Responses of single-channel records (u (N,), y (N,)), and a report.

    Parameters
    ----------
    sample_rate
        Sampling frequency [Hz] of all records.
    most
        Largest number of frequencies; more are thinned to equal spacing in log frequency.

    Raises
    ------
    InputError
        As `checked_record`, `periodic_response` and `local_response`; or the records have no common
        excited lines, or no common frequency with information.
    """
    pairs = [
        tuple(part[:, 0] for part in checked_record(u[:, None], y[:, None])) for u, y in records
    ]
    periods = {period(u) for u, _ in pairs}
    length = min(len(u) for u, _ in pairs)
    if len(periods) == 1 and (samples := periods.pop()) is not None and length >= 2 * samples:
        return _periodic(pairs, samples, length // samples, sample_rate, most)
    frequency = spaced_in_log(np.arange(1.0, (length + 1) // 2), most) * sample_rate / length
    return _arbitrary(pairs, frequency, sample_rate)


def _periodic(
    pairs: Sequence[tuple[RealArray, ...]], samples: int, count: int, rate: float, most: int
) -> tuple[list[ResponseEstimate], str]:
    """Responses from whole periods, without the first period if it has not settled."""
    spectra = [
        tuple(np.fft.rfft(x[-count * samples :].reshape(count, samples)).T for x in pair)
        for pair in pairs
    ]
    unsettled = count > 2 and any(_unsettled(Y) for _, Y in spectra)
    spectra = [(U[:, unsettled:], Y[:, unsettled:]) for U, Y in spectra]
    lines = excited(spectra[0][0])
    for U, _ in spectra[1:]:
        lines = np.intersect1d(lines, excited(U))
    if lines.size < 2:
        raise InputError(
            f"the inputs have {lines.size} excited lines in common; two are needed: excite all "
            "plants by the same signal"
        )
    chosen = spaced_in_log(lines, most)
    frequency = chosen * rate / samples
    thinning = f", {chosen.size} taken" if chosen.size < lines.size else ""
    excitation = f"{lines.size} excited lines{thinning}"
    if count < MANY_PERIODS and np.median(np.diff(lines)) <= DENSE:
        means = [tuple(mean_of_periods(x, samples) for x in pair) for pair in pairs]
        found, said = _arbitrary(means, frequency, rate)
        return found, f"{count} periods of {samples} samples, averaged; {excitation}; {said}"
    friction = [
        dry_friction(U, Y, lines, samples, samples * repeated_rounding(y, samples, 2))
        for (U, Y), (_, y) in zip(spectra, pairs, strict=True)
    ]
    if not is_certain(friction):
        friction = [None] * len(pairs)
    found = [
        _of_periods(U, Y, lines, chosen, frequency, pair, samples, lost)
        for (U, Y), pair, lost in zip(spectra, pairs, friction, strict=True)
    ]
    dropped = ", the first left out as not settled" if unsettled else ""
    told = [f"{count} periods of {samples} samples{dropped}", excitation, *_told_narrow(found)]
    return found, "; ".join(told)


def _of_periods(
    U: np.ndarray,
    Y: np.ndarray,
    lines: IntegerArray,
    chosen: IntegerArray,
    frequency: RealArray,
    pair: tuple[RealArray, ...],
    samples: int,
    friction: DryFriction | None,
) -> PeriodicResponse:
    """Response of a record (u, y) at chosen lines, from amplitudes U, Y (lines, periods), without
    its friction.
    """

    def estimated(drive: np.ndarray) -> PeriodicResponse:
        alone = periodic_response(frequency, drive[chosen], Y[chosen])
        noisy = _with_rounding(alone, drive[chosen], pair, samples)
        return with_neighbours(noisy, drive, Y, lines, chosen)

    found = estimated(U)
    if friction is None:
        return found
    return friction.taken_out(estimated(U - friction.amplitudes[:, None]), found)


def _with_rounding(
    estimate: PeriodicResponse, U: np.ndarray, pair: tuple[RealArray, ...], samples: int
) -> PeriodicResponse:
    """The estimate with the variance of repeated rounding added, for amplitudes U (F, periods)."""
    u, y = (repeated_rounding(x, samples, k) for x, k in zip(pair, (FEWEST_LEVELS, 2), strict=True))
    size = samples / np.abs(U.mean(axis=1)[:, None, None]) ** 2
    more = size * (y + np.abs(estimate.response) ** 2 * u)
    return replace(
        estimate, variance=estimate.variance + more, covariance=estimate.covariance + more
    )


def mean_of_periods(x: RealArray, samples: int) -> RealArray:
    """Mean (samples,) of the last whole periods of a signal.

    It contains only the lines that the input excites. So the scatter about a local model includes
    the distortions of a nonlinear plant, which are at these lines only.
    """
    count = len(x) // samples
    mean: RealArray = x[-count * samples :].reshape(count, samples).mean(axis=0)
    return mean


def _arbitrary(
    pairs: Sequence[tuple[RealArray, ...]], frequency: RealArray, rate: float
) -> tuple[list[ResponseEstimate], str]:
    """Responses by local models, each from a whole record, at common frequencies (F,) [Hz].

    Frequencies at which a record has no information are left out.
    """
    found = [
        averaged_models(u[:, None], y[:, None], 1.0 / rate, frequency_hz=frequency)
        for u, y in pairs
    ]
    known = np.all([informative(one) for one in found], axis=0)
    if known.sum() < 2:
        raise InputError(
            f"the records tell of {known.sum()} common frequencies; two are needed: excite more "
            "lines, or average longer"
        )
    kept = [
        replace(
            one,
            frequency_hz=one.frequency_hz[known],
            response=one.response[known],
            variance=one.variance[known],
        )
        for one in found
    ]
    said = [f"local models of several widths, averaged, at {known.sum()} frequencies"]
    if not known.all():
        lost = frequency[~known]
        said.append(
            f"{lost.size} from {lost[0]:.4g} to {lost[-1]:.4g} Hz left out, where a record tells "
            "nothing: its input excites too few lines, or its noise is far larger than any response"
        )
    said += _told_narrow(kept)
    return kept, "; ".join(said)


def _told_narrow(estimates: Sequence[ResponseEstimate]) -> list[str]:
    """A sentence about resonances too narrow for the spacing of frequencies; None without them."""
    narrow = np.unique(np.concatenate([_narrow_resonances(one) for one in estimates]))
    if not narrow.size:
        return []
    places = ", ".join(f"{one:.4g}" for one in narrow[:NAMED])
    return [
        f"resonances near {places} Hz are narrower than the distance of the frequencies, and "
        "may be higher between them"
    ]


def _narrow_resonances(estimate: ResponseEstimate) -> RealArray:
    """Resonance frequencies [Hz]: both neighbours have less than half their power, with regions."""
    size, radius = np.abs(estimate.response[:, 0, 0]), estimate.radius(confidence=TOLD)[:, 0, 0]
    beside = np.maximum((size + radius)[:-2], (size + radius)[2:])
    peaks = (size - radius)[1:-1] > np.sqrt(2.0) * beside
    found: RealArray = estimate.frequency_hz[1:-1][peaks]
    return found


def informative(estimate: ResponseEstimate) -> BoolArray:
    """Mask (F,) of frequencies at which all regions are small enough to be informative."""
    radius = estimate.radius(confidence=TOLD)
    sure = np.where(np.isfinite(radius), np.abs(estimate.response) - radius, 0.0).max(axis=0)
    known: BoolArray = (radius < LARGER_BY_FAR * sure).all(axis=(1, 2))
    return known


def _unsettled(Y: np.ndarray) -> bool:
    """Whether the first period is farther from the mean of the others than these are."""
    rest = Y[:, 1:]
    middle = rest.mean(axis=1, keepdims=True)
    count = rest.shape[1]
    own = np.sum(np.abs(rest - middle) ** 2) / max(count - 1, 1)
    first = np.sum(np.abs(Y[:, :1] - middle) ** 2) / (1 + 1 / count)
    rounding = np.finfo(float).eps * np.sum(np.abs(middle) ** 2)
    return bool(first > SETTLED**2 * own + rounding)


def excited(U: np.ndarray) -> IntegerArray:
    """Lines that the input excites, from amplitudes (lines, periods); without first and last."""
    return excited_together(U[..., None, None])


def excited_together(U: np.ndarray) -> IntegerArray:
    """Lines at which the experiments excite all channels independently of each other.

    U holds amplitudes (lines, periods, channels, experiments); the first and the last line never
    count.
    """
    mean = np.linalg.svd(U.mean(axis=1), compute_uv=False)[:, -1]
    scatter = U.std(axis=1, ddof=1) / np.sqrt(U.shape[1]) if U.shape[1] > 1 else 0.0 * U[:, 0]
    spread = np.linalg.norm(scatter, axis=(1, 2))
    mean[0] = mean[-1] = 0.0
    enough = np.maximum(EXCITED * mean.max(), OF_NEIGHBOURS * _largest_near(mean))
    return np.flatnonzero((mean > enough) & (mean > EXCITED_OVER_NOISE * spread))


def _largest_near(amplitude: RealArray) -> RealArray:
    """Largest amplitude (lines,) within half an octave of each line."""
    band = np.floor(PER_OCTAVE * np.log2(np.maximum(np.arange(amplitude.size), 1))).astype(int)
    largest = np.zeros(int(band[-1]) + 1)
    np.maximum.at(largest, band, amplitude)
    near: RealArray = maximum_filter1d(largest, PER_OCTAVE + 1)[band]
    return near
