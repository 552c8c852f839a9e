"""A PI or PID controller as a process engineer tunes it, for the true nominal plant.

S. Skogestad, Simple analytic rules for model reduction and PID controller tuning, Journal of
Process Control 13 (2003) 291-309: the half rule, then the settings for a plant with one or two
lags. For an unstable plant the settings are searched on a grid: those with the widest bandwidth
whose sensitivity stays below a limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .linear import LinearPlant
from .stranger import Array

PEAK = 1.7
"""Largest peak sensitivity of a good loop; for an unstable plant it is `UNSTABLE_PEAK`."""
UNSTABLE_PEAK = 1.95
SLOWER = 1.25
"""Factor by which the closed loop is made slower until its sensitivity is below the limit."""
WIDE, POINTS = 1e4, 4000


@dataclass(frozen=True)
class Pid:
    """u = gain (1 + 1 / (integral s)) (1 + derivative s) / (1 + derivative s / 10) e."""

    gain: float
    integral: float
    derivative: float = 0.0

    def response(self, omega: Array) -> Array:
        """Frequency response (F,)."""
        s = 1j * omega
        lead = (1 + self.derivative * s) / (1 + 0.1 * self.derivative * s)
        return self.gain * (1 + 1 / (self.integral * s)) * lead


def half_rule(plant: LinearPlant, hold: float) -> tuple[float, float, float, float, bool]:
    """Gain, two lags, dead time, and whether the plant integrates; ``hold`` [s] is the computer's
    delay.

    The gain of an integrating plant is the slope of its step response. A pair of complex poles
    counts as two lags with the magnitude of the poles.
    """
    poles, zeros = plant.poles, plant.zeros
    slowest = np.abs(poles).min()
    integrates = slowest < 1e-6 * np.abs(poles).max() or slowest < 1e-9
    finite = poles[np.abs(poles) > (1e-6 * np.abs(poles).max())]
    lags = np.sort(1 / np.abs(finite))[::-1]
    right = zeros[zeros.real > 0]
    dead = plant.delay + hold + float(np.sum(1 / np.abs(right)))
    low = 1e-5 * np.abs(finite).min() if finite.size else 1e-6
    gain = plant.response(np.array([low]))[0, 0, 0]
    sign = np.sign(gain.imag * -1 if integrates else gain.real)
    if integrates:
        slope = sign * abs(gain) * low
        second = float(lags[0]) if lags.size else 0.0
        dead += float(lags[1] / 2 + lags[2:].sum()) if lags.size > 1 else 0.0
        return slope, np.inf, second, dead, True
    first, second = float(lags[0]), float(lags[1]) if lags.size > 1 else 0.0
    dead += float(lags[2] / 2 + lags[3:].sum()) if lags.size > 2 else 0.0
    return float(sign * abs(gain)), first, second, dead, False


def settings(plant: LinearPlant, hold: float, closed: float) -> Pid:
    """SIMC settings for a closed loop with time constant ``closed`` [s]."""
    gain, first, second, dead, integrates = half_rule(plant, hold)
    if integrates:
        return Pid(1 / (gain * (closed + dead)), 4 * (closed + dead), second)
    return Pid(first / (gain * (closed + dead)), min(first, 4 * (closed + dead)), second)


def loop(plant: LinearPlant, controller: Pid, hold: float, omega: Array) -> Array:
    """Loop transfer function (F,): plant, controller and the computer's delay."""
    late = np.exp(-1j * omega * hold)
    open_loop: Array = plant.response(omega)[:, 0, 0] * controller.response(omega) * late
    return open_loop


def encloses(open_loop: Array, unstable: int, integrators: int) -> bool:
    """Whether the closed loop is stable, from the turns of 1 + L between low and high
    frequencies.
    """
    turned = np.unwrap(np.angle(1 + open_loop))
    return bool(abs((turned[-1] - turned[0]) - np.pi * (unstable + 0.5 * integrators)) < 0.5)


def tuned(plant: LinearPlant, hold: float) -> Pid | None:
    """The SIMC controller, made slower until its loop is good; for an unstable plant the best PID.

    None if no such controller is found.
    """
    size = np.abs(plant.poles)
    omega = np.geomspace(1e-3 * size[size > 0].min(), WIDE * size.max(), POINTS)
    unstable = int((plant.poles.real > 1e-9 * size.max()).sum())
    if unstable:
        return _best_pid(plant, hold, omega, unstable)
    *_, dead, integrates = half_rule(plant, hold)
    for closed in dead * SLOWER ** np.arange(25):
        found = settings(plant, hold, float(closed))
        open_loop = loop(plant, found, hold, omega)
        good = np.abs(1 / (1 + open_loop)).max() <= PEAK
        if good and encloses(open_loop, 0, 1 + integrates):
            return found
    return None


def _best_pid(plant: LinearPlant, hold: float, omega: Array, unstable: int) -> Pid | None:
    """The PID controller with the widest bandwidth on a grid."""
    speed = float(plant.poles.real.max())
    static = abs(plant.response(np.array([1e-3 * speed]))[0, 0, 0])
    sign = -np.sign(plant.response(np.array([1e-3 * speed]))[0, 0, 0].real)
    best, widest = None, 0.0
    for gain in np.geomspace(1.2, 10, 16):
        for derivative in np.geomspace(0.2, 5, 16) / speed:
            for integral in np.array([5.0, 10.0, 20.0]) / speed:
                one = Pid(sign * gain / static, integral, derivative)
                open_loop = loop(plant, one, hold, omega)
                S = 1 / (1 + open_loop)
                if np.abs(S).max() > UNSTABLE_PEAK or not encloses(open_loop, unstable, 1):
                    continue
                wide = float(omega[np.argmax(np.abs(S) > np.sqrt(0.5))])
                if wide > widest:
                    best, widest = one, wide
    return best
