"""Quality checks of a record: missing values, dead channels, saturated converters."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import InputError
from workbench.identification.record_tests.clipping import held_share


class IdentificationWarning(UserWarning):
    """The data can be used but need attention; the message says what to do.

    Examples
    --------
    >>> import warnings
    >>> import numpy as np
    >>> from workbench.identification import IdentificationWarning, periodic_response
    >>> noisy = np.array([[1.0, -0.8, 1.1, -0.9]])
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always")
    ...     response = periodic_response([1.0], noisy, noisy)
    ...
    >>> caught[0].category is IdentificationWarning
    True
    """


def as_record(signal: ArrayLike, *, name: str = "record") -> np.ndarray:
    """The record as a float array (..., N) of finite samples.

    Raises
    ------
    InputError
        The record is empty, complex or not numeric; or a sample is NaN or infinite: the message
        names the first one and its channel.

    Examples
    --------
    >>> from workbench.identification import as_record
    >>> as_record([1, 2, 3]).dtype.name
    'float64'
    """
    values = np.asarray(signal)
    if values.dtype.kind not in "biuf":
        raise InputError(f"{name} must hold real numbers, not {values.dtype}")
    if values.ndim == 0 or values.size == 0:
        raise InputError(f"{name} has no samples: its shape is {values.shape}")
    values = values.astype(float)
    wrong = ~np.isfinite(values)
    if wrong.any():
        *channel, sample = (int(i) for i in np.argwhere(wrong)[0])
        place = f"channel {', '.join(map(str, channel))}, " if channel else ""
        raise InputError(
            f"{name} has {wrong.sum()} samples that are NaN or infinite, the first at {place}"
            f"sample {sample}: cut the record there or fill the gap"
        )
    return values


def require_alive(record: np.ndarray, name: str) -> None:
    """Raise `InputError` if a channel of the record (..., N) never changes."""
    dead = np.argwhere(np.ptp(np.atleast_2d(record), axis=-1) == 0)
    if len(dead):
        channel = ", ".join(str(i) for i in dead[0])
        raise InputError(
            f"{name}: channel {channel} never changes: check its cable and range, or leave it out"
        )


def checked_record(u: ArrayLike, y: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """A record as float arrays u (N, nu) and y (N, ny); one channel may be given as (N,).

    Raises
    ------
    InputError
        Shapes are wrong, lengths differ, values are not finite, or a channel never changes.
    """
    pair = []
    for name, values in (("u", u), ("y", y)):
        if np.ndim(values) == 1:
            values = np.reshape(np.asarray(values), (-1, 1))
        if np.ndim(values) != 2:
            raise InputError(
                f"{name} has shape {np.shape(values)}; an array of samples by channels is needed"
            )
        channels = as_record(np.transpose(values), name=name)
        require_alive(channels, name)
        pair.append(channels.T)
    if len(pair[0]) != len(pair[1]):
        raise InputError(f"u has {len(pair[0])} samples and y {len(pair[1])}; they must be equal")
    return pair[0], pair[1]


def saturation(signal: ArrayLike, *, limits: tuple[float, float] | None = None) -> np.ndarray:
    """Share of saturated samples in each channel: those at an end of the converter's range.

    With ``limits`` every sample at or beyond a limit counts. Without them the range is estimated
    from the record: an extreme value is a limit if the signal stays there for two samples or more
    and the line through the two samples before exceeds it by more than the converter's step. So the
    crest of a sine in coarse steps and the levels of a binary signal do not count.

    Parameters
    ----------
    signal
        Real, shape (..., N).
    limits
        Ends of the range, in the signal's unit.

    Returns
    -------
    ndarray
        Shares between 0 and 1, shape (...).

    Examples
    --------
    >>> from workbench.identification import saturation
    >>> saturation([0.0, 1.0, 1.0, 0.5], limits=(-1.0, 1.0)).tolist()
    0.5
    """
    values = as_record(signal)
    if limits is not None:
        low, high = limits
        if not low < high:
            raise InputError(f"limits must rise, not {limits}")
        return np.mean((values <= low) | (values >= high), axis=-1)
    rows = values.reshape(-1, values.shape[-1])
    shares = [held_share(row) + held_share(-row) for row in rows]
    return np.reshape(shares, values.shape[:-1])
