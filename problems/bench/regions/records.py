"""Records of plants: excitations, and a data acquisition of 12 bits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from workbench.types import RealArray

from .plants import Plant

Band = tuple[float, float]
Excitation = Callable[[np.random.Generator, int, Band], RealArray]
"""Function that makes a signal (N,) of about unit size that excites a band [cycles/sample]."""
BITS = 12
"""Bits of the converters of input and output."""
PERIODS = 3
"""Number of periods of a multisine in a record."""
USED = 0.8
"""Share of a converter's range that a signal uses."""


def prbs(rng: np.random.Generator, samples: int, band: Band) -> RealArray:
    """A binary signal that may change only at multiples of a clock's tick."""
    tick = max(1, int(0.4 / band[1]))
    return held(rng.choice([-1.0, 1.0], -(-samples // tick)), tick, samples)


def steps(rng: np.random.Generator, samples: int, band: Band) -> RealArray:
    """Steps between two levels at slightly irregular instants."""
    count = 8
    each = samples // count
    holds = rng.integers(int(0.6 * each), int(1.4 * each), 2 * count)
    levels = np.tile([1.0, -1.0], count)
    return np.repeat(levels, holds)[:samples]


def sweep(rng: np.random.Generator, samples: int, band: Band) -> RealArray:
    """A sine whose frequency rises through the band, by the same factor every second."""
    low, high = max(band[0], 3 / samples), band[1]
    rate = np.log(high / low) / samples
    phase = 2 * np.pi * low * np.expm1(rate * np.arange(samples)) / rate
    found: RealArray = np.sin(phase + rng.uniform(0, 2 * np.pi))
    return found


def multisine(rng: np.random.Generator, samples: int, band: Band) -> RealArray:
    """A few periods of a multisine with random phases, and equal amplitudes up to the end of the
    band.
    """
    period = samples // PERIODS
    lines = np.arange(1, int(band[1] * period))
    spectrum = np.zeros(period // 2 + 1, complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.uniform(size=lines.size))
    one = np.fft.irfft(spectrum, period)
    return np.tile(one / one.std(), PERIODS + 1)[:samples]


def noise(rng: np.random.Generator, samples: int, band: Band) -> RealArray:
    """Gaussian noise through a lag with its corner at the end of the band."""
    factor = np.exp(-2 * np.pi * band[1] / 2)
    found = lfilter([1.0], [1.0, -factor], rng.standard_normal(samples))
    return np.asarray(found / found.std())


def working_log(rng: np.random.Generator, samples: int, band: Band) -> RealArray:
    """Set-points of random size that change at random instants, as operators change them."""
    count = 25
    instants = np.sort(rng.integers(0, samples, count))
    levels = rng.uniform(-1.5, 1.5, count + 1)
    return levels[np.searchsorted(instants, np.arange(samples), side="right")]


def held(values: RealArray, tick: int, samples: int) -> RealArray:
    """Each value is held for a tick of this many samples."""
    return np.repeat(values, tick)[:samples]


EXCITATIONS: dict[str, Excitation] = {
    "prbs": prbs,
    "steps": steps,
    "sweep": sweep,
    "multisine": multisine,
    "noise": noise,
    "working log": working_log,
}
"""Excitations of the plants, by name."""
RUNNING = ("noise", "working log")
"""Excitations with which the plant is already running when the record begins."""


def quantised(x: RealArray) -> RealArray:
    """Signals (..., N) as a converter shows them if they use a part of its range."""
    step = 2 * np.abs(x).max(axis=-1, keepdims=True) / (USED * 2**BITS)
    return np.round(x / step) * step


def record(
    plant: Plant,
    excitation: str,
    samples: int,
    decibels: float,
    rngs: list[np.random.Generator],
    colour: float = 0.0,
) -> tuple[RealArray, RealArray, RealArray]:
    """Inputs (R, inputs, N) and outputs (R, N), one record per generator, and the noise's size
    (R,).

    The input is the output of the converter, so that it is known exactly. Both signals have
    offsets. ``colour`` is the correlation of the noise from sample to sample.
    """
    before = samples if excitation in RUNNING else 0
    make, count = EXCITATIONS[excitation], len(plant.channels)
    u = np.array([[make(rng, before + samples, plant.band) for _ in range(count)] for rng in rngs])
    u[:, 1::2] = u[:, 1::2, ::-1]  # every second input runs backwards, so that two sweeps differ
    u = quantised(u)
    clean = plant.output(u)[:, before:]
    u = u[..., before:]
    white = np.array([rng.standard_normal(samples + 100) for rng in rngs])
    added = lfilter([np.sqrt(1 - colour**2)], [1.0, -colour], white, axis=-1)[:, 100:]
    size = clean.std(axis=-1) * 10 ** (-decibels / 20)
    shift = np.array([rng.uniform(0.5, 2.0) for rng in rngs])[:, None]
    y = quantised(clean + size[:, None] * added + shift * clean.std(axis=-1, keepdims=True))
    return u + shift[:, :, None], y, size
