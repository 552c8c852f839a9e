"""Dry friction of a plant that a multisine moves, estimated from the silent lines of its record.

Dry friction is a constant force against the velocity. In a response it looks like damping, and the
more the smaller the excitation: the resonances of the linear plant, which moves without stopping,
are higher than those of the response. A linear plant would not move at lines that the input does
not excite. The motion there that the sign of the velocity explains shows the size of the friction.
The input minus the friction drives the linear plant.

Source for the output at silent lines: R. Pintelon, J. Schoukens, System Identification: A Frequency
Domain Approach, 2nd edition, 2012, section 4.3. For friction as the sign of the velocity: B.
Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30 (1994) 1083-1138, section 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from workbench._core.arrays import ComplexArray, IntegerArray, RealArray
from workbench.identification.responses.periodic import PeriodicResponse
from workbench.identification.responses.silent_lines import NEAR, SURE

EXPLAINED = 2 / 3
"""Plants of one kind have dry friction if the sign of the velocity explains at least this share of
the power at silent lines, without noise, in the median of their records: then nothing else bends
them as much. A valve with different gains in both directions explains a half.
"""
ROUNDS = 6
"""Number of times that friction and response are found from each other."""
ORDERS = (1, 0)
"""The velocity is a derivative of the output of one of these orders: the output is a position or a
velocity.
"""


@dataclass(frozen=True, eq=False)
class DryFriction:
    """Dry friction of a record: its size in the unit of the input, its amplitudes (K,) at all
    lines, and the share of the power at silent lines that it explains.

    What drives the linear plant is the input without these amplitudes.
    """

    size: float
    amplitudes: ComplexArray
    explained: float

    def taken_out(self, estimate: PeriodicResponse, before: PeriodicResponse) -> PeriodicResponse:
        """An estimate without friction, with its variance extended by what is unsure about it.

        ``before`` is the estimate with friction. The friction is as unsure as the power that it
        leaves at silent lines.
        """
        away = np.abs(estimate.response - before.response) ** 2
        more = max(1.0 - self.explained, 0.0) * away
        return replace(
            estimate,
            variance=estimate.variance + more,
            covariance=estimate.covariance + more,
            dry_friction=self.size,
        )


def dry_friction(
    u: ComplexArray, y: ComplexArray, lines: IntegerArray, samples: int, repeated: float = 0.0
) -> DryFriction | None:
    """What the silent lines of a record show of dry friction; None if too few lines are silent.

    `is_certain` tells whether it is dry friction. The output is measured where the friction acts.

    Parameters
    ----------
    u, y
        Amplitudes (K, periods) at all lines, as from `numpy.fft.rfft` of whole periods.
    lines
        Excited lines.
    samples
        Samples of a period.
    repeated
        Power of errors at each line of the output that repeat in every period, as rounding does.
    """
    if y.shape[1] < 2:
        return None
    scatter = uniform_filter1d(y.var(axis=1, ddof=1), NEAR) / y.shape[1] + repeated
    scatter += np.finfo(float).eps ** 2 * np.sum(np.abs(y[lines]) ** 2)
    u, y = u.mean(axis=1), y.mean(axis=1)
    # Beyond the last line that is seen in the output, the response is noise.
    seen = np.flatnonzero(np.abs(y[lines]) ** 2 > SURE**2 * scatter[lines])
    lines = lines[: seen.max(initial=-1) + 1]
    if lines.size < 2:
        return None
    silent = np.setdiff1d(np.arange(lines[0], lines[-1]), lines)
    if silent.size < NEAR:
        return None
    number = np.arange(y.size)
    sure = (np.abs(y) ** 2 > SURE**2 * scatter) & (number <= lines[-1])
    found = []
    for order in ORDERS:
        velocity = np.where(sure, (1j * number) ** order * y, 0.0)
        if order == 0:
            velocity[0] = y[0]
        # What moves along with the input may be measured in the opposite direction.
        turn = np.sign(np.sum((u[lines].conj() * velocity[lines]).real))
        direction = turn * _sign(velocity, samples)
        found.append(_of_velocity(u, y, lines, silent, scatter, direction))
    return max(found, key=lambda one: one.explained)


def is_certain(found: Sequence[DryFriction | None]) -> bool:
    """Whether plants of one kind have dry friction, from what their records show."""
    shares = [0.0 if one is None else one.explained for one in found]
    return float(np.median(shares)) >= EXPLAINED


def _sign(amplitudes: ComplexArray, samples: int) -> ComplexArray:
    """Amplitudes (K,) of the sign of a signal that is given by its own."""
    sign = np.sign(np.fft.irfft(amplitudes, samples))
    return np.fft.rfft(sign - sign.mean())


def _of_velocity(
    u: ComplexArray,
    y: ComplexArray,
    lines: IntegerArray,
    silent: IntegerArray,
    scatter: RealArray,
    direction: ComplexArray,
) -> DryFriction:
    """The friction that acts against a velocity, from the amplitudes (K,) of its sign."""
    size, explained = 0.0, 0.0
    for _ in range(ROUNDS):
        G = y[lines] / (u[lines] - size * direction[lines])
        turned = np.log(np.abs(G)) + 1j * np.unwrap(np.angle(G))
        log, logs = np.log(silent), np.log(lines)
        g = np.exp(np.interp(log, logs, turned.real) + 1j * np.interp(log, logs, turned.imag))
        left = (y[silent] - g * u[silent]) / np.sqrt(scatter[silent])
        way = -g * direction[silent] / np.sqrt(scatter[silent])
        power = float(np.sum(np.abs(way) ** 2))
        if power == 0.0:
            break
        size = max(float(np.sum((way.conj() * left).real)) / power, 0.0)
        # Noise has a power of 1 at each line, which varies by as much. Where there is no friction,
        # it explains 1/2.
        unsure = SURE * silent.size**0.5
        beyond = max(float(np.sum(np.abs(left) ** 2)) - silent.size, unsure)
        explained = (size**2 * power - 0.5) / beyond
    return DryFriction(size, size * direction, explained)
