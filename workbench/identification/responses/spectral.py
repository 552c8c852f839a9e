"""Frequency response from one arbitrary record, by averaged spectra."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import InputError
from workbench.identification.experiments.quality import as_record, require_alive
from workbench.identification.experiments.reports import report_of_arrays
from workbench.identification.responses.periodic import ResponseEstimate
from workbench.input_checks import need_positive


@dataclass(frozen=True, eq=False, repr=False)
class SpectralResponse(ResponseEstimate):
    """A response from averaged spectra.

    Unlike a `ResponseEstimate` in general, it also has the coherence and the spectrum of the
    noise.

    Parameters
    ----------
    noise
        One-sided power spectral density per Hz, shape (F, outputs), of the part of each output that
        the inputs do not explain.
    coherence
        Share of each output's power that the inputs explain, shape (F, outputs).
    segments
        Effective number of independent segments.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import spectral_response
    >>> u = np.random.default_rng(0).standard_normal(1000)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> found = spectral_response(u, y, dt=1 / 1.0, segment=50)
    >>> bool(found.coherence.min() > 0.9), found.response.shape
    (True, (24, 1, 1))
    """

    noise: np.ndarray
    coherence: np.ndarray
    segments: float


def spectral_response(
    u: ArrayLike,
    y: ArrayLike,
    dt: float,
    segment: int,
    *,
    assume: str | Sequence[str] = (),
) -> SpectralResponse:
    """Spectral estimate G = S_yu S_uu^-1 (equation 4.3) by Welch's averages, with its variance.

    The segments overlap by half and have Hann windows. At each line the estimate is a linear
    regression over the segments, and its residuals give the variance. Overlapping segments count as
    a smaller number of independent ones (Welch, IEEE Trans. Audio Electroacoust. 15(2), 1967). The
    inputs are assumed to have no noise and no feedback from the output's noise; for a plant in a
    closed loop use `driven_response`. Resonances narrower than a few 1 / (dt segment) are
    flattened, which the variance does not include: compare with a longer segment.

    Parameters
    ----------
    u
        Inputs, shape (N,) or (inputs, N).
    y
        Outputs, shape (N,) or (outputs, N).
    dt
        Sampling time [s].
    segment
        Number of samples in a segment.
    assume
        Assumptions about the record that you vouch for although its `record_report` rejects them.

    Returns
    -------
    SpectralResponse
        Response at the lines strictly between 0 and the Nyquist frequency.

    Raises
    ------
    InputError
        NaN, a dead channel, different lengths, a finding that forbids the use of the record, too
        few segments for the inputs, or inputs that are linearly dependent at some frequency.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import spectral_response
    >>> u = np.random.default_rng(0).standard_normal(1000)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> found = spectral_response(u, y, dt=1 / 1.0, segment=50)
    >>> exact = 0.5 / (np.exp(1j * found.omega) - 0.5)
    >>> bool(abs(found.response[:, 0, 0] / exact - 1).max() < 0.1)
    True
    """
    inputs, outputs = np.atleast_2d(as_record(u, name="u")), np.atleast_2d(as_record(y, name="y"))
    require_alive(inputs, "u")
    require_alive(outputs, "y")
    if inputs.shape[1] != outputs.shape[1]:
        raise InputError(f"u has {inputs.shape[1]} samples, y has {outputs.shape[1]}")
    need_positive(dt, "dt")
    report = report_of_arrays(inputs.T, outputs.T, assume, dt)
    if segment < 8:
        raise InputError(f"a segment needs 8 samples or more, not {segment}")
    hop = segment // 2
    count = (inputs.shape[1] - segment) // hop + 1
    window = np.hanning(segment + 1)[:-1]
    segments = _independent(count, window, hop)
    spare = segments - len(inputs)
    if count < 1 or spare < 1:
        raise InputError(
            f"{inputs.shape[1]} samples make {max(count, 0)} half-overlapping segments of "
            f"{segment}: too few for {len(inputs)} inputs; shorten the segment or measure longer"
        )
    lines = slice(1, (segment + 1) // 2)
    spectra_u, spectra_y = (_spectra(x, window, hop)[..., lines] for x in (inputs, outputs))
    uu = np.einsum("isf,jsf->fij", spectra_u, spectra_u.conj()) / count
    yu = np.einsum("isf,jsf->fij", spectra_y, spectra_u.conj()) / count
    frequency = np.arange(segment // 2 + 1)[lines] / dt / segment
    condition = np.linalg.cond(uu)
    if not np.all(condition < 1e12):
        at = frequency[int(np.argmax(condition))]
        raise InputError(f"the inputs do not excite at {at:g} Hz, or move together: excite anew")
    inverse = np.linalg.inv(uu)
    response = yu @ inverse
    # Residuals of each segment: S_yy - G S_uy would lose digits if the coherence is near one.
    residual = spectra_y - np.einsum("fij,jsf->isf", response, spectra_u)
    unexplained = np.mean(np.abs(residual) ** 2, axis=1).T
    noise = unexplained * segments / spare
    power = np.mean(np.abs(spectra_y) ** 2, axis=1).T
    spread = np.einsum("fjj->fj", inverse).real
    return SpectralResponse(
        frequency_hz=frequency,
        response=response,
        variance=noise[:, :, None] * spread[:, None, :] / segments,
        degrees=2 * spare,
        noise=2 * noise * dt / np.sum(window**2),
        coherence=1 - unexplained / power,
        segments=segments,
        report=report,
    )


def _spectra(record: np.ndarray, window: np.ndarray, hop: int) -> np.ndarray:
    """Windowed spectra (channels, segments, lines) of a record without its mean."""
    record = record - record.mean(axis=1, keepdims=True)
    cut = np.lib.stride_tricks.sliding_window_view(record, len(window), axis=1)[:, ::hop]
    return np.fft.rfft(cut * window, axis=-1)


def _independent(count: int, window: np.ndarray, hop: int) -> float:
    """Number of independent segments equivalent to ``count`` overlapping ones."""
    if count < 1:
        return 0.0
    overlap = np.sum(window[hop:] * window[:-hop]) / np.sum(window**2)
    return count / (1 + 2 * (1 - 1 / count) * overlap**2)
