"""Nonlinear distortion: responses to a periodic input at lines that the input does not contain.

Source: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
2012, section 4.3.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import f

from workbench._core.arrays import Array, ComplexArray, IntegerArray, RealArray
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.flags import unflagged
from workbench.identification.record_tests.impulse import gaps_filled
from workbench.identification.record_tests.levels import resolution
from workbench.identification.record_tests.periods import period
from workbench.identification.record_tests.record import RecordData

LINEAR = "the plant is linear"
"""Name of the tested assumption."""
FEWEST_PERIODS = 3
"""Fewest periods: one to settle, and two to determine the noise."""
EXCITED = 1e-3
"""Amplitude from which a line counts as excited, relative to the largest."""
HARMONICS = 3
"""Distortion is searched up to this multiple of the highest excited line."""
LEAST = 0.01
"""Distortion relative to the excited lines above which it is harmful."""
OVER_CHANGES = 3.0
"""Least ratio of distortion to the change between periods, which noise and settling cause."""
OVER_STEPS = 2.0
"""Least ratio of distortion to the rounding error of a converter."""
OVER_INPUT = 10.0
"""Least ratio of distortion to the response that the largest gain would give to the input at the
same lines.
"""
HELD = 0.3
"""Share of samples equal to the previous one, from which a sensor counts as holding its values."""
CHANCE = 1e-6
"""Probability of so much distortion if there is only noise."""


def nonlinearity(record: RecordData) -> TestedAssumption:
    """Test whether the plant is linear, as far as a periodic input shows it."""
    clean = unflagged(record)
    if len(record.starts) > 1:
        return TestedAssumption(LINEAR, "several experiments", testable=False)
    lengths = {period(u) for u in clean.u.T}
    samples = lengths.pop() if len(lengths) == 1 else None
    if samples is None or len(clean.u) < FEWEST_PERIODS * samples:
        return TestedAssumption(LINEAR, "the inputs do not repeat three times", testable=False)
    inputs = [_lines(u, samples) for u in clean.u.T]
    sizes = np.sqrt(sum(np.mean(np.abs(U), axis=0) ** 2 for U in inputs))
    excited = np.flatnonzero(sizes > EXCITED * sizes[1:].max())
    excited = excited[excited > 0]
    silent = np.setdiff1d(
        np.arange(1, min(HARMONICS * int(excited.max()), samples // 2 - 1) + 1), excited
    )
    if not silent.size:
        return TestedAssumption(LINEAR, "the inputs excite every line", testable=False)
    found, told = [], []
    for name, y in zip(record.outputs, clean.y.T, strict=True):
        if np.mean(y[1:] == y[:-1]) > HELD:
            told.append(f"{name!r} holds its values for several samples, which looks the same")
            continue
        share, certain = _distortion(
            _lines(gaps_filled(y), samples), sizes, excited, silent, resolution(y)
        )
        told.append(f"distortion of {name!r} is {share:.2g} of its answer")
        if certain:
            found.append(
                Finding(
                    "distortion",
                    f"{name!r} holds {share:.2g} of its answer at lines that the input does not "
                    "excite, in every period alike: the plant is not linear, or a disturbance "
                    "keeps the input's period",
                    f"output {name!r}, {silent.size} silent lines",
                    share,
                    "size at silent lines over that at excited ones",
                    "excite less, or count the distortion as uncertainty "
                    "(`best_linear_approximation`)",
                )
            )
    testable = not all(np.mean(y[1:] == y[:-1]) > HELD for y in clean.y.T)
    return TestedAssumption(LINEAR, "; ".join(told), testable=testable, findings=tuple(found))


def _lines(signal: RealArray, samples: int) -> ComplexArray:
    """Amplitudes (periods, lines) of a signal (N,), without its first period and its slope."""
    count = len(signal) // samples
    periods = signal[len(signal) - count * samples :].reshape(count, samples)[1:]
    levels = periods.mean(axis=1)
    slope = float(np.polyfit(np.arange(count - 1), levels, 1)[0]) / samples
    ramp = slope * (np.arange(samples) - samples / 2)
    return np.fft.rfft(periods - levels[:, None] - ramp, axis=1)


def _distortion(
    Y: ComplexArray, sizes: RealArray, excited: IntegerArray, silent: IntegerArray, step: float
) -> tuple[float, bool]:
    """Size at silent lines over that at excited ones, and whether only distortion explains it."""
    mean = Y.mean(axis=0)

    def size(values: Array) -> float:
        return float(np.sqrt(np.sum(np.abs(values) ** 2)))

    there, answer = size(mean[silent]), size(mean[excited])
    change = size(Y[-1, silent] - Y[0, silent])
    gain = float(np.max(np.abs(mean[excited]) / sizes[excited]))
    count = len(Y)
    noise = float(np.sum(np.var(Y[:, silent], axis=0, ddof=1))) / count
    ratio = there**2 / (noise + np.finfo(float).eps ** 2 * answer**2)
    chance = float(f.sf(ratio, 2 * silent.size, 2 * silent.size * (count - 1)))
    rounding = step / np.sqrt(12) * Y.shape[1] * np.sqrt(0.5)
    limit = max(
        LEAST * answer,
        OVER_CHANGES * change,
        OVER_STEPS * rounding,
        OVER_INPUT * gain * size(sizes[silent]),
    )
    return there / max(answer, np.finfo(float).tiny), there > limit and chance < CHANCE
