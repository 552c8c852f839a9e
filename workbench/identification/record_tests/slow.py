"""Slow parts of a record: the slowest mode that responds to the inputs, and drift.

Means over blocks are fitted by lags and fast modes of the inputs, one slow mode, and polynomials of
time for drift. The slow mode's time constant comes from the profile of the sum of squares. The
plant's state before the record is unknown, and a slow mode that has not settled looks like drift.
So drift must be larger than everything that slow modes of the size found can cause in this way.

Source: W. Murphy, A. van der Vaart, "On profile likelihood", Journal of the American Statistical
Association 95, 2000.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.stats import chi2

from workbench._core.arrays import RealArray
from workbench.identification.record_tests.delay import delays, explained, first_impulses
from workbench.identification.record_tests.excitation import sines
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.flags import unflagged
from workbench.identification.record_tests.impulse import blocks, gaps_filled
from workbench.identification.record_tests.record import RecordData, once

MOST_BLOCKS = 600
"""Most blocks of a record."""
BLOCKS_EACH = 4
"""Fewest blocks for each fitted number."""
TAPS = 3
"""Number of lags of each input, for responses that take a block or two."""
FAST = (3.0, 8.0, 20.0)
"""Time constants [blocks] of modes that settle within the record."""
CONSTANTS = np.append(np.geomspace(30.0, 10.0 * MOST_BLOCKS, 40), np.inf)
"""Time constants [blocks] that are tried for the slow mode; infinite: an integrator."""
FEWEST_MOVES = 30.0
"""Fewest moves of an input; with fewer, its response resembles drift."""
FEW_SINES = 2
"""An input with at most this many sines says nothing about slow modes."""
DEGREES = 3
"""Largest degree of the polynomials for drift."""
SURE = float(chi2.isf(1e-6, DEGREES))
"""Twice the gain of log likelihood above which drift, or a slow mode, is not chance."""
ALLOWED = float(chi2.isf(1e-3, 1))
"""Twice the loss of log likelihood up to which a time constant is as good as the best one."""
FEWEST_CONSTANTS = 5.0
"""Fewest time constants that a record must last for a mode to settle."""
LARGE = 0.2
"""Movement of a drift, relative to the standard deviation of the output, above which it
is harmful.
"""
BEFORE = 2.0
"""Standard deviations by which an input before the record is assumed to differ from its mean, at
least.
"""
FARTHEST = 5.0
"""The same at most, for an input that was off and whose mean is far from 0."""
SINGULAR, OUTPUT_ROUNDING = 1e-9, 1e-7
"""Least singular value that counts, relative to the largest; and rounding error of
fitted outputs.
"""
CERTAIN = 3.0
"""Number of standard deviations that are added to the size of slow modes, for certainty."""


@dataclass(frozen=True)
class Slow:
    """The slowest mode and the drift of one output.

    ``least`` and ``most`` [samples] enclose the time constant; None if no slow mode responds.
    ``drift`` is the movement of the fitted polynomials of time, relative to the output's standard
    deviation; ``certain`` says that neither chance nor a slow mode explains it.
    """

    least: float | None
    most: float | None
    drift: float
    certain: bool


@once
def slow_parts(record: RecordData) -> tuple[Slow | None, ...]:
    """The slow part of each output in the longest experiment; None if that is too short."""
    clean = unflagged(record)
    longest = max(clean.pieces(), key=lambda piece: piece.stop - piece.start)
    count = longest.stop - longest.start
    size = max(1, -(-count // MOST_BLOCKS))
    found: list[Slow | None] = []
    if any(sines(column, FEW_SINES).size for column in clean.u[longest].T):
        return (None,) * clean.y.shape[1]
    for i, y in enumerate(clean.y[longest].T):
        waits = [one.least or 0 for one in delays(record) if one.output == i]
        u = np.column_stack(
            [_delayed(column, wait) for wait, column in zip(waits, clean.u[longest].T, strict=True)]
        )
        response = first_impulses(record)[0][i]
        soon = explained(record)[longest, i]
        first = 0 if response is None else -(-response.response.shape[1] // size)
        averaged = [blocks(each, size) for each in (u, gaps_filled(y), soon)]
        found.append(_slow_part(averaged[0], averaged[1], averaged[2], size, first))
    return tuple(found)


def _slow_part(u: RealArray, y: RealArray, soon: RealArray, size: int, first: int) -> Slow | None:
    """The slow part of an output (B,) and inputs (B, nu), averaged over blocks.

    ``soon`` (B,) is the fast response to the inputs, by impulse responses at full rate; it is known
    from the ``first`` block on. ``size`` is the number of samples in a block.
    """
    spread, u_size = float(y.std()), u.std(axis=0)
    # An input that only ripples within the blocks says nothing about slow modes.
    moving = u_size > 0
    u, u_size = u[:, moving], u_size[moving]
    time = np.arange(len(y))
    count = u.shape[1] * (TAPS + len(FAST) + 1) + len(FAST) + 1 + DEGREES
    if not spread > 0 or len(y) - first < BLOCKS_EACH * count or (moves(u) < FEWEST_MOVES).any():
        return None
    away = np.abs(u.mean(axis=0)) / u_size
    y, soon, time = y[first:], soon[first:], time[first:]
    u, y = (u - u.mean(axis=0)) / u_size, (y - y.mean()) / spread
    trends = np.polynomial.legendre.legvander(np.linspace(-1, 1, len(y)), DEGREES)[:, 1:]
    fast = np.column_stack(
        [np.ones(len(y)), soon / (float(np.abs(soon).max()) or 1.0)]
        + [_delayed(column, k)[first:] for column in u.T for k in range(TAPS)]
        + [answered_lines(u, constant)[first:] for constant in FAST]
        + [np.exp(-time / constant) for constant in FAST]
    )
    both = np.hstack([fast, trends])
    least = most = None
    fits = [_fitted(np.hstack([answered_lines(u, each)[first:], both]), y) for each in CONSTANTS]
    sums = np.array([left @ left for left, _, _ in fits])
    free = _independent(fits[int(np.argmin(sums))][0])
    left = _fitted(both, y)[0]
    accepted = free * np.log(sums / sums.min()) < ALLOWED
    if free * np.log(left @ left / sums.min()) > SURE:
        ends = CONSTANTS[accepted][[0, -1]]
        if ends[0] > CONSTANTS[0]:
            least, most = float(ends[0]) * size, float(ends[1]) * size
    plain = [
        _fitted(np.hstack([answered_lines(u, each)[first:], fast]), y)[0] for each in CONSTANTS
    ]
    chance = free * np.log(min(left @ left for left in plain) / sums.min()) < SURE
    movement = float(np.ptp(trends @ fits[int(np.argmin(sums))][1][-DEGREES:]))
    # The response of a slow mode if the inputs had other values before the record.
    ones = np.repeat(BEFORE + np.minimum(away, FARTHEST)[None], len(u), axis=0)
    made, own = 0.0, slice(u.shape[1])
    for k in np.flatnonzero(accepted):
        before = np.ptp(answered_lines(ones, CONSTANTS[k])[first:], axis=0)
        deviation = np.sqrt(np.diag(fits[k][2])[own] * len(y) / free)
        made = max(made, float(before @ (np.abs(fits[k][1][own]) + CERTAIN * deviation)))
    return Slow(least, most, movement, bool(not chance and movement > made))


def moves(u: RealArray) -> RealArray:
    """Effective number (nu,) of moves in the changes of inputs (B, nu): large ones count most."""
    squares = np.diff(u, axis=0) ** 2
    return np.asarray(squares.sum(axis=0) ** 2 / np.maximum((squares**2).sum(axis=0), 1e-300))


def _delayed(column: RealArray, wait: int) -> RealArray:
    """A signal (N,) delayed by ``wait`` samples; it starts with its first value."""
    return np.concatenate([np.full(wait, column[0]), column[: len(column) - wait]])


def answered_lines(u: RealArray, constant: float) -> RealArray:
    """Responses (B, nu), from rest, of a mode with a time constant to the inputs."""
    pole = np.exp(-1 / constant)
    return np.asarray(lfilter([1 / min(constant, len(u))], [1.0, -pole], u, axis=0))


def _fitted(basis: RealArray, y: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """Residual of an output in least squares, the weights, and their covariance in white noise."""
    left_vectors, sizes, right = np.linalg.svd(basis, full_matrices=False)
    kept = sizes > SINGULAR * sizes[0]
    inverse = right[kept].T / sizes[kept]
    weight = inverse @ (left_vectors[:, kept].T @ y)
    left = y - basis @ weight
    left = left + OUTPUT_ROUNDING * (-1.0) ** np.arange(len(y))
    noise = float(left @ left) / max(len(y) - int(kept.sum()), 1)
    return left, weight, noise * inverse @ inverse.T


def _independent(left: RealArray) -> float:
    """Number of independent samples with the information of the correlated ones (B,)."""
    near = float(left[1:] @ left[:-1]) / float(left @ left)
    near = min(max(near, 0.0), 0.99)
    return len(left) * (1 - near) / (1 + near)


def long_record(record: RecordData) -> TestedAssumption:
    """Test whether the record is long compared with the slowest mode."""
    assumption = "the record lasts long against the slowest mode"
    parts = slow_parts(record)
    found, told = [], []
    samples = max(piece.stop - piece.start for piece in record.pieces())
    for name, one in zip(record.outputs, parts, strict=True):
        if one is None or one.least is None or one.most is None:
            told.append(f"{name!r}: no slow mode is seen")
            continue
        dt = record.sample_time
        upper = f"{one.most * dt:.3g} s" if np.isfinite(one.most) else "an integrator"
        told.append(f"{name!r}: time constant of {one.least * dt:.3g} s to {upper}")
        if one.least * FEWEST_CONSTANTS > samples:
            found.append(
                Finding(
                    "short record",
                    f"the slowest mode of {name!r} has a time constant of {one.least * dt:.3g} s "
                    f"at least, and the longest experiment lasts {samples * dt:.3g} s: it does not "
                    "settle, or integrates",
                    f"output {name!r}, whole record",
                    samples / one.least,
                    "time constants that the record lasts, at most",
                    f"record {FEWEST_CONSTANTS:g} time constants or more; of an integrating plant "
                    "take differences of the output, or give the fit its pole",
                )
            )
    testable = any(one is not None for one in parts)
    if not testable:
        told = [f"{samples} samples are too few, or inputs move too seldom"]
    return TestedAssumption(assumption, "; ".join(told), testable=testable, findings=tuple(found))


def drift(record: RecordData) -> TestedAssumption:
    """Test whether outputs stay where the inputs hold them."""
    assumption = "outputs do not drift"
    parts = slow_parts(record)
    found, told = [], []
    for name, y, one in zip(record.outputs, unflagged(record).y.T, parts, strict=True):
        if one is None:
            continue
        told.append(f"{name!r}: moves by {one.drift:.2g} of its deviation")
        if one.drift > LARGE and one.certain:
            found.append(
                Finding(
                    "drift",
                    f"{name!r} drifts by {one.drift * np.nanstd(y):.3g}, {one.drift:.2g} of its "
                    "standard deviation, over the record, and no input makes it",
                    f"output {name!r}, whole record",
                    float(one.drift),
                    "movement of the drift over the standard deviation of the output",
                    "let the plant warm up, or take a slow polynomial off the output",
                )
            )
    if not told:
        return TestedAssumption(
            assumption, "too few samples, or inputs that move too seldom", testable=False
        )
    return TestedAssumption(assumption, "; ".join(told), findings=tuple(found))
