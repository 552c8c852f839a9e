"""Frequency response from the response to steps (section 4.1.2 of the thesis, after Ljung).

A step and the response to it do not decay, so their transforms do not exist. Their differences from
sample to sample do decay, once the system has settled, and have the same ratio: G = sum dy_k z^-k /
sum du_k z^-k, without leakage and without a model. A step has little information at high
frequencies: its differences have the same size at all frequencies, but those of the noise grow with
the frequency and with the square root of the length of the record.

The noise of the first and of the last sample would add to that of the differences, and dominate at
low frequencies. So the differences are faded in before a step and faded out at the end of its
record, while the signals are at rest; this averages over those samples.

Source: L. Ljung, System Identification, 2nd ed., 1999, section 6.1.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.experiments.quality import IdentificationWarning, as_record
from workbench.identification.responses.periodic import PeriodicResponse, periodic_response
from workbench.input_checks import need_positive

STILL_MOVING = 5.0
"""Number of standard deviations by which the last tenth of a record may differ from the tenth
before it.
"""
SETTLED = 1e-6
"""Motion that never counts, relative to the largest change of the output."""


def step_response(
    u: ArrayLike,
    y: ArrayLike,
    starts: ArrayLike,
    frequency_hz: ArrayLike,
    dt: float,
    length: int,
) -> PeriodicResponse:
    """Response from repeated steps of the input, with its variance from their scatter.

    The steps may have any size and either sign, but the same shape, and the system must have
    settled before each. Noise of the input is allowed, as in `periodic_response`.

    Parameters
    ----------
    u, y
        Input and output, shape (N,).
    dt
        Sampling time [s].
    starts
        Indices (M,) of the first sample of each step, two or more, each at least 1.
    length
        Number of samples evaluated from each start on. The system must settle in nine tenths of
        them, and have settled a tenth of them before the first step.
    frequency_hz
        Frequencies [Hz], shape (F,), between 0 and half the sample rate.

    Raises
    ------
    InputError
        Fewer than two steps, a step that the record does not contain completely, steps that
        overlap, a frequency outside the range, or a record without a step.

    Warns
    -----
    IdentificationWarning
        The output is still moving at the end of the steps.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import step_response
    >>> u = np.tile(np.r_[np.zeros(200), np.ones(200)], 3)
    >>> y = control.forced_response(control.tf([0.1], [1, -0.9], 0.01), inputs=u).outputs
    >>> found = step_response(u, y, [200, 400, 600], [1.0], 0.01, 200)
    >>> exact = control.tf([0.1], [1, -0.9], 0.01)(np.exp(2j * np.pi * 0.01))
    >>> bool(abs(found.response[0, 0, 0] / exact - 1) < 1e-3)
    True
    """
    need_positive(dt, "dt")
    signals = [as_record(one, name=name) for one, name in ((u, "u"), (y, "y"))]
    frequencies = np.atleast_1d(as_record(frequency_hz, name="frequency_hz"))
    first = np.atleast_1d(np.asarray(starts))
    if signals[0].ndim != 1 or signals[0].shape != signals[1].shape:
        raise InputError(
            f"u has shape {signals[0].shape}, y has {signals[1].shape}; (N,) is needed"
        )
    if not (np.all(frequencies > 0) and np.all(frequencies < 0.5 / dt)):
        raise InputError(f"frequencies must lie between 0 and {0.5 / dt:g} Hz")
    if first.dtype.kind not in "iu" or first.size < 2 or length < 20:
        raise InputError("two steps of 20 samples or more are needed, their starts whole numbers")
    fade = length // 10
    if np.any(np.diff(first) < length) or first[0] <= fade or first[-1] + length > len(signals[0]):
        raise InputError(
            f"steps of {length} samples must not overlap, and must begin after {fade} samples or "
            f"more and end within the {len(signals[0])} samples of the record"
        )
    instants = np.arange(-fade, length)
    du, dy = (np.diff(one)[first[:, None] - 1 + instants] for one in signals)
    size = du @ du[0]
    if not np.all(np.abs(size) > 0):
        raise InputError("the input makes no step at one of the starts")
    # Steps of either sign and of any size become repetitions of the first one.
    du, dy = (one * (size[0] / size)[:, None] for one in (du, dy))
    _warn_of_motion(dy)
    rise = np.sin(np.pi / 2 * (np.arange(fade) + 0.5) / fade) ** 2
    window = np.concatenate([rise, np.ones(length - fade), rise[::-1]])
    turn = window * np.exp(-2j * np.pi * dt * np.outer(frequencies, instants))
    return periodic_response(frequencies, turn @ du.T, turn @ dy.T)


def _warn_of_motion(dy: RealArray) -> None:
    """Warn if the mean output of the steps still changes between their last two tenths."""
    tenth = dy.shape[1] // 11
    level = np.cumsum(dy, axis=1)
    moved = level[:, -tenth:].mean(axis=1) - level[:, -2 * tenth : -tenth].mean(axis=1)
    error = moved.std(ddof=1) / np.sqrt(len(moved))
    if abs(moved.mean()) > STILL_MOVING * error + SETTLED * np.abs(level).max():
        warnings.warn(
            f"the output still moves by {moved.mean():.3g} at the end of the steps: the response "
            "is biased; let each step last longer",
            IdentificationWarning,
            stacklevel=3,
        )
