"""Excitation: whether each input moves at enough frequencies, and often enough.

A sum of k sines determines 2 k numbers of a response and no more: it is persistently exciting of
order 2 k. A model of order n with one input has 2 n + 1 numbers.

Source: L. Ljung, System Identification, 2nd ed., 1999, section 13.2.
"""

from __future__ import annotations

import numpy as np
from scipy.signal.windows import hann

from workbench._core.arrays import RealArray
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.flags import unflagged
from workbench.identification.record_tests.levels import runs
from workbench.identification.record_tests.record import RecordData

LEAST_ORDER = 2
"""Model order for which every record must be sufficient: one resonance."""
UNEXPLAINED = 1e-4
"""Share of an input's variance that counts as noise or rounding if a few sines explain the rest."""
LOBE = 5
"""Number of lines over which a Hann window spreads a sine."""
SCREENED = 0.98
"""If the largest lines hold less than this share of the energy, an input is not a sum
of few sines.
"""
FEWEST_TURNS = 1.5
"""A sine with fewer turns in the record than this counts as a slow movement."""
REFINED, REFINED_ON = 8, 50_000
"""Number of rounds that refine the frequencies of sines, and number of samples that are used."""
STILL = 0.9
"""Share of the record above which a constant input is reported."""


def excitation(record: RecordData) -> TestedAssumption:
    """Test whether each input moves at enough frequencies, and often enough."""
    record = unflagged(record)
    needed = 2 * (LEAST_ORDER if record.order is None else record.order) + 1
    longest = max(record.pieces(), key=lambda piece: piece.stop - piece.start)
    found, told = [], []
    for name, u in zip(record.inputs, record.u.T, strict=True):
        lines = sines(u[longest], (needed - 1) // 2)
        told.append(
            f"{name!r} is persistently exciting of order "
            + (f"{2 * lines.size}" if lines.size else f"{needed} or more")
        )
        if lines.size:
            found.append(_few_lines(name, lines / record.sample_time, needed))
        else:
            found += _seldom_moved(name, u, record, needed)
    return TestedAssumption(
        "inputs excite what is asked for", "; ".join(told), findings=tuple(found)
    )


def _few_lines(name: str, frequency: RealArray, needed: int) -> Finding:
    """The finding for an input that is a sum of a few sines."""
    where = ", ".join(f"{f:.6g} Hz" for f in frequency)
    order = max((2 * frequency.size - 1) // 2, 0)
    one = frequency.size == 1
    return Finding(
        "excitation",
        f"{name!r} is {'one sine' if one else f'{frequency.size} sines'}: it tells the response at "
        f"{where} alone, and everywhere else a model is a guess (order {order} at most is "
        f"determined, {needed - 1 - needed // 2} is asked for)",
        f"input {name!r}, whole record",
        float(frequency.size),
        "frequencies that the input holds",
        "excite more frequencies, by noise, a binary signal or a multisine",
    )


def _seldom_moved(name: str, u: RealArray, record: RecordData, needed: int) -> list[Finding]:
    """Findings for an input that hardly ever moves, or is constant for most of the record."""
    moves = np.diff(u) != 0
    moves[[first - 1 for first in record.starts if first]] = False
    count = int(moves.sum())
    if not count:
        return []
    first, length = runs(~moves)
    longest = int(length.max(initial=0)) + 1
    if count < needed:
        return [
            Finding(
                "excitation",
                f"{name!r} moves at {count} of {len(u)} samples: what happens there by chance is "
                "taken for the plant",
                f"input {name!r}, whole record",
                float(count),
                "samples at which the input moves",
                "repeat the move, in both directions",
            )
        ]
    if longest > STILL * len(u):
        start = int(first[np.argmax(length)])
        return [
            Finding(
                "excitation",
                f"{name!r} stands still for {longest} of {len(u)} samples: they tell the "
                "disturbance and nothing of the plant",
                f"input {name!r}, samples {start} to {start + longest - 1}",
                longest / len(u),
                "share of the record in which the input stands still",
                "cut the record where the outputs have settled, or excite longer",
            )
        ]
    return []


def sines(u: RealArray, most: int) -> RealArray:
    """Frequencies [cycles/sample] of the sines that make up an input (N,); empty if none fit.

    There may be at most ``most`` sines, and in addition a level and a slope.
    """
    n = len(u)
    if n < 8 * (most + 1) or np.ptp(u) == 0:
        return np.zeros(0)
    time = np.linspace(-1, 1, n)
    u = u - np.polynomial.polynomial.polyval(time, np.polynomial.polynomial.polyfit(time, u, 1))
    size = np.sqrt(np.mean(u**2))
    if not size > 0:
        return np.zeros(0)
    u = u / size
    power = np.abs(np.fft.rfft(u * hann(n, sym=False))) ** 2
    largest = np.partition(power, -min(LOBE * most, power.size))[-min(LOBE * most, power.size) :]
    if largest.sum() < SCREENED * power.sum():
        return np.zeros(0)
    found, u = np.zeros(0), u[:REFINED_ON]
    left = u
    for _ in range(most):
        found, left = _refined(np.append(found, _peak(left)), u)
        if np.mean(left**2) < UNEXPLAINED:
            return np.sort(found) if (found * n > FEWEST_TURNS).all() else np.zeros(0)
    return np.zeros(0)


def _peak(signal: RealArray) -> float:
    """Frequency [cycles/sample] of the largest line of a signal (N,), interpolated."""
    n = len(signal)
    size = np.abs(np.fft.rfft(signal * hann(n, sym=False)))
    k = int(np.clip(np.argmax(size), 1, size.size - 2))
    left, middle, right = np.log(np.maximum(size[k - 1 : k + 2], np.finfo(float).tiny))
    bend = left - 2 * middle + right
    return float((k + (0.5 * (left - right) / bend if bend < 0 else 0.0)) / n)


def _refined(frequency: RealArray, u: RealArray) -> tuple[RealArray, RealArray]:
    """Frequencies of sines that fit an input best, and the remainder, by Gauss-Newton."""
    time = np.arange(len(u)) - len(u) / 2
    for _ in range(REFINED):
        turns = 2 * np.pi * np.outer(time, frequency)
        basis = np.hstack([np.cos(turns), np.sin(turns), np.ones((len(u), 1)), time[:, None]])
        basis[:, -1] /= len(u)
        weight = np.linalg.lstsq(basis, u, rcond=None)[0]
        left = u - basis @ weight
        k = frequency.size
        across = basis[:, :k] * weight[k : 2 * k] - basis[:, k : 2 * k] * weight[:k]
        slope = 2 * np.pi * time[:, None] * across
        step = np.linalg.lstsq(np.hstack([basis, slope]), left, rcond=None)[0][-k:]
        frequency = np.clip(frequency + step, 0.0, 0.5)
        if np.abs(step).max() < 1e-9:
            break
    return frequency, left
