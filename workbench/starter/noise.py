"""The measurement noise in records."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench._core.arrays import RealArray

SEGMENTS = 8
"""Number of segments of a record, without overlap, whose spectra are averaged."""
UPPER = 0.5
"""Noise is estimated in this fraction of the frequencies, the highest ones."""


def rms_of_noise(records: Sequence[tuple[RealArray, RealArray]]) -> float:
    """The rms of white measurement noise: the largest over the records (u, y).

    The noise spectrum is the part of the output's spectrum that the input does not explain (the
    spectrum times one minus the coherence), in the upper half of the frequencies, where the plant's
    gain is small. The median over frequency ignores lines.

    Source: J. S. Bendat, A. G. Piersol, Random Data, 4th ed., Wiley 2010, section 6.2: the noise
    spectrum of the output; by chance the input explains 1 / segments of it.
    """
    from scipy.signal import csd, welch

    found = []
    for record in records:
        u, y = (np.asarray(signal, dtype=float).ravel() for signal in record)
        length = u.size // SEGMENTS
        given = {"fs": 1.0, "nperseg": length, "noverlap": 0, "detrend": "linear"}
        _, of_u = welch(u, **given)
        frequency, of_y = welch(y, **given)
        _, cross = csd(u, y, **given)
        explained = np.abs(cross) ** 2 / np.where(of_u > 0, of_u, np.inf)
        left = np.maximum(of_y - explained, 0.0) * SEGMENTS / (SEGMENTS - 1)
        upper = left[frequency >= (1 - UPPER) / 2]
        found.append(float(np.sqrt(np.median(upper) / 2)))
    return max(found)
