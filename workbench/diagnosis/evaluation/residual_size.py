"""Residual evaluation: the size J(r) of a residual over a moving window."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench._core.compiled import compiled
from workbench.errors import InputError
from workbench.input_checks import as_array, need_places, need_whole
from workbench.simulation import Controller


def moving_rms(window: int, *, signals: Sequence[int] = (0,)) -> Controller:
    """The root mean square of the Euclidean norm of some signals over the last `window` samples.

        J[k]^2 = mean of r_1[i]^2 + ... + r_m[i]^2 over i = k - window + 1 ... k,

    At the start of a record the mean is over the samples so far. `signals` are the numbers of the
    measurements that are residuals. Raises InputError if the window is shorter than one sample or
    there are no signals.

    Examples
    --------
    >>> from workbench.diagnosis import moving_rms
    >>> from workbench.simulation import play
    >>> play(moving_rms(window=2), [[3.0], [3.0], [0.0]]).ravel().round(4).tolist()
    [3.0, 3.0, 2.1213]
    """
    need_whole(window, "window")
    if not isinstance(signals, Sequence):
        raise InputError(f"signals are {signals!r}; a list of numbers of measurements is needed")
    for one in signals:
        need_places(signal=one)
    if window < 1 or not len(signals):
        raise InputError(f"window {window} over {len(signals)} signals; both must be 1 or more")
    parameters = np.array([window, *signals], float)
    return Controller(_moving_rms, np.zeros(2 + window), parameters, reads=max(signals) + 1)


@compiled
def _moving_rms(
    state: RealArray, parameters: RealArray, measurement: RealArray, output: RealArray
) -> None:
    """One sample. The state is the number of samples, the sum of squares, and a ring of squares."""
    window = int(parameters[0])
    seen, place = int(state[0]), 2 + int(state[0]) % window
    square = 0.0
    for j in range(1, len(parameters)):
        square += measurement[int(parameters[j])] ** 2
    state[1] += square - state[place]
    state[place] = square
    if place == 1 + window:  # sum anew once a window, so that rounding errors do not accumulate
        state[1] = 0.0
        for i in range(2, 2 + window):
            state[1] += state[i]
    state[0] = seen + 1
    output[0] = math.sqrt(max(state[1], 0.0) / min(seen + 1, window))


def as_series(name: str, values: ArrayLike) -> RealArray:
    """A record as an array (N,).

    Raises InputError, with the record's name, unless it is 1-D, finite and not empty.
    """
    array = as_array(values, name)
    if array.ndim != 1 or not array.size:
        raise InputError(f"{name} has shape {array.shape}; it must be (N,) with a sample or more")
    if not np.isfinite(array).all():
        first = np.flatnonzero(~np.isfinite(array))[0]
        raise InputError(f"{name} is not finite, first at sample {first} of {len(array)}")
    return array
