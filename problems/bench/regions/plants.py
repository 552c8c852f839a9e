"""Plants with known true responses, sampled exactly behind a hold, one sample per second."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from workbench.types import ComplexArray, RealArray


@dataclass(frozen=True)
class Mode:
    """One pole [rad/s] of a plant, and its residue."""

    pole: complex
    residue: complex


@dataclass(frozen=True)
class Channel:
    """Sum of residue / (s - pole), delayed, from one input that is held over each sample.

    A pole with an imaginary part also represents its conjugate.
    """

    modes: tuple[Mode, ...]
    delay: float = 0.0

    def _parts(self) -> list[tuple[complex, complex, complex]]:
        """For each mode the factor exp(p), and the weights of the newer and the older input."""
        late = self.delay % 1.0
        found = []
        for mode in self.modes:
            p, r = mode.pole, mode.residue
            if p == 0:
                newer, older = r * (1 - late), r * late
            else:
                newer = r * (np.exp(p * (1 - late)) - 1) / p
                older = r * (np.exp(p) - np.exp(p * (1 - late))) / p
            found.append((np.exp(p), newer, older))
        return found

    def response(self, frequency: RealArray) -> ComplexArray:
        """Response from samples of the input to samples of the output, at frequencies
        [cycles/sample].
        """
        z = np.exp(2j * np.pi * frequency)
        total = np.zeros(z.shape, complex)
        for mode, (factor, newer, older) in zip(self.modes, self._parts(), strict=True):
            total += (newer + older / z) / (z - factor)
            if mode.pole.imag:
                total += (newer.conjugate() + older.conjugate() / z) / (z - factor.conjugate())
        return total * z ** -float(int(self.delay))

    def polynomials(self) -> tuple[RealArray, RealArray]:
        """Numerator and denominator in powers of 1/z, without the whole samples of the delay."""
        below, parts = np.ones(1, complex), []
        for mode, (factor, newer, older) in zip(self.modes, self._parts(), strict=True):
            for conjugate in (False, True)[: 2 if mode.pole.imag else 1]:
                f, a, b = (np.conj(x) if conjugate else x for x in (factor, newer, older))
                parts.append((np.array([0.0, a, b]), np.array([1.0, -f])))
        above = np.zeros(len(parts) + 2, complex)
        for k, (top, _) in enumerate(parts):
            for other, (_, bottom) in enumerate(parts):
                if other != k:
                    top = np.convolve(top, bottom)
            above += top
        for _, bottom in parts:
            below = np.convolve(below, bottom)
        last = (
            len(above) if self.delay % 1.0 else len(above) - 1
        )  # no older input, so one term less
        return above.real[:last], below.real

    def output(self, u: RealArray) -> RealArray:
        """Output for inputs (..., N), from rest."""
        total = np.zeros(u.shape)
        for mode, (factor, newer, older) in zip(self.modes, self._parts(), strict=True):
            part = lfilter([0.0, newer, older], [1.0, -factor], u, axis=-1)
            total += 2 * part.real if mode.pole.imag else part.real
        whole = int(self.delay)
        return np.concatenate([np.zeros((*u.shape[:-1], whole)), total], -1)[..., : u.shape[-1]]


@dataclass(frozen=True)
class Friction:
    """A mass with viscous and dry friction, from force to speed.

    It has no linear response of its own; its true response is the best linear approximation.
    """

    lag: float
    dry: float
    steps: int = 4

    def output(self, u: RealArray) -> RealArray:
        """Speed for records (..., N) of the force, from rest."""
        v, found = np.zeros(u.shape[:-1]), np.empty(u.shape)
        for k in range(u.shape[-1]):
            found[..., k] = v
            v = self.step(v, u[..., k])
        return found

    def step(self, v: RealArray, force: RealArray) -> RealArray:
        """Speed one sample after a speed, by the classical Runge-Kutta method."""
        h = 1.0 / self.steps

        def slope(v: RealArray) -> RealArray:
            drag: RealArray = (force - v - self.dry * np.tanh(v / 0.05)) / self.lag
            return drag

        for _ in range(self.steps):
            a = slope(v)
            b = slope(v + h / 2 * a)
            c = slope(v + h / 2 * b)
            d = slope(v + h * c)
            v = v + h / 6 * (a + 2 * b + 2 * c + d)
        return v


@dataclass(frozen=True)
class Plant:
    """A plant with one channel per input, and the lengths [samples] of its short and long records.

    ``band`` holds the lowest and highest frequency [cycles/sample] that experiments excite.
    """

    channels: tuple[Channel | Friction, ...]
    short: int
    long: int
    band: tuple[float, float]

    def output(self, u: RealArray) -> RealArray:
        """Output (..., N) for inputs (..., inputs, N), from rest."""
        parts = [channel.output(u[..., k, :]) for k, channel in enumerate(self.channels)]
        total: RealArray = np.sum(parts, axis=0)
        return total


def lags(gain: float, *constants: float, delay: float = 0.0, zero: float = 0.0) -> Channel:
    """Channel gain (1 + zero s) exp(-delay s) / prod(1 + constant s); the time constants [s] must
    differ.
    """
    poles = [-1.0 / one for one in constants]
    modes = []
    for p in poles:
        others = float(np.prod([1 / (1 - p / q) for q in poles if q != p]))
        modes.append(Mode(p, gain * -p * (1 + zero * p) * others))
    return Channel(tuple(modes), delay)


def resonance(gain: float, at: float, damping: float) -> Mode:
    """Mode of gain w^2 / (s^2 + 2 damping w s + w^2), with its frequency `at` in cycles
    per sample.
    """
    w = 2 * np.pi * at
    damped = w * np.sqrt(1 - damping**2)
    return Mode(complex(-damping * w, damped), gain * w**2 / (2j * damped))


def modes(*found: Mode | Channel) -> Channel:
    """One channel that holds these modes and those of other channels without delay."""
    parts = [one.modes if isinstance(one, Channel) else (one,) for one in found]
    return Channel(tuple(mode for part in parts for mode in part))


def _integrator(gain: float, lag: float) -> Channel:
    """Channel gain / (s (1 + lag s))."""
    return Channel((Mode(0.0, gain), Mode(-1 / lag, -gain)))


SLOW, MIDDLE, WIDE = (5e-4, 0.05), (2e-3, 0.2), (2e-3, 0.4)
PLANTS: dict[str, Plant] = {
    "lag": Plant((lags(2.0, 100.0),), 1800, 9000, SLOW),
    "two tanks": Plant((lags(1.5, 38.0, 31.0, delay=3.3),), 1300, 6000, SLOW),
    "three tanks": Plant((lags(0.8, 34.0, 25.0, 18.0, delay=11.6),), 1500, 6000, SLOW),
    "dead time": Plant((lags(1.0, 12.0, delay=45.5),), 1500, 6000, SLOW),
    "fast lag": Plant((lags(1.0, 4.0, 1.5),), 600, 4000, WIDE),
    "damping 0.1": Plant((modes(resonance(1.0, 0.03, 0.1)),), 1000, 6000, MIDDLE),
    "damping 0.03": Plant(
        (modes(resonance(1.0, 0.05, 0.03), lags(0.5, 20.0)),), 1500, 8000, MIDDLE
    ),
    "damping 0.01": Plant((modes(resonance(1.0, 0.1, 0.01)),), 1500, 8000, WIDE),
    "damping 0.001": Plant(
        (modes(resonance(0.2, 0.08, 0.001), lags(1.0, 8.0)),), 2500, 16000, WIDE
    ),
    "close pair": Plant(
        (modes(resonance(1.0, 0.05, 0.01), resonance(0.7, 0.056, 0.015)),), 2000, 10000, MIDDLE
    ),
    "far pair": Plant(
        (modes(resonance(1.0, 0.03, 0.003), resonance(-0.2, 0.15, 0.008)),), 2500, 12000, WIDE
    ),
    "integrator": Plant((_integrator(0.05, 10.0),), 1500, 8000, SLOW),
    "arm": Plant(
        (modes(_integrator(0.02, 30.0), resonance(0.2, 0.07, 0.02)),), 2000, 10000, MIDDLE
    ),
    "zero to the right": Plant((lags(1.0, 30.0, 10.0, zero=-15.0),), 1200, 6000, SLOW),
    "friction": Plant((Friction(15.0, 0.1),), 1200, 6000, MIDDLE),
    "two inputs": Plant((lags(1.0, 30.0), lags(-0.6, 20.0, 8.0, delay=5.5)), 1500, 8000, SLOW),
    "two inputs, resonance": Plant(
        (modes(resonance(1.0, 0.05, 0.02)), modes(resonance(-0.5, 0.05, 0.02), lags(1.0, 10.0))),
        2000,
        10000,
        MIDDLE,
    ),
}
"""The plants by name."""


def heaters() -> list[Plant]:
    """Six two-tank heaters: time constants of 160 to 230 s, dead times of 13 to 18 s, sampled every
    5 s.
    """
    found = []
    for k in range(6):
        slow = (160.0 + 14.0 * k) / 5.0
        channel = lags(1.2 + 0.06 * (k % 3), slow, 0.8 * slow, delay=(13.0 + k) / 5.0)
        found.append(Plant((channel,), int(18 * slow), int(30 * slow), SLOW))
    return found
