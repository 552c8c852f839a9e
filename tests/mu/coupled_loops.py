"""Random loops of two channels with dead time, and what is true of them in 50 digits."""

from dataclasses import dataclass

import mpmath
import numpy as np
from delayed_loops import DIGITS

from workbench.uncertainty import append, block, delay, tf

GRID = np.geomspace(1e-4, 1e3, 12_000)
"""Frequencies [rad/s] in a unit of time of 1."""


def late(T, name="tau"):
    return delay(name, T, T)


@dataclass(frozen=True)
class TwoByTwo:
    """Lags gain / (lag s + 1) exp(-s dead), (2, 2) each, and PI control gain (1 + rate / s)."""

    gain: np.ndarray
    lag: np.ndarray
    dead: np.ndarray
    control: np.ndarray
    rate: np.ndarray
    unit: float

    @property
    def plant(self):
        return block(
            [
                [
                    tf([float(self.gain[i, j])], [float(self.lag[i, j] * self.unit), 1.0])
                    * late(float(self.dead[i, j] * self.unit), f"tau_{i}{j}")
                    for j in range(2)
                ]
                for i in range(2)
            ]
        )

    @property
    def controller(self):
        pairs = zip(self.control.tolist(), (self.rate / self.unit).tolist(), strict=True)
        return append(*(tf([k, k * rate], [1, 0]) for k, rate in pairs))

    def loop(self, channel, s, exp=np.exp):
        """L at the channel's input (the same at its output), the other one closed; unit 1."""
        g = [
            [
                self.gain[i, j] / (self.lag[i, j] * s + 1) * exp(-s * self.dead[i, j])
                for j in range(2)
            ]
            for i in range(2)
        ]
        c = [k * (1 + rate / s) for k, rate in zip(self.control, self.rate, strict=True)]
        k, o = channel, 1 - channel
        return c[k] * (g[k][k] - g[k][o] * g[o][k] * c[o] / (1 + g[o][o] * c[o]))

    def determinant(self, s):
        """det(1 + G K) with K's poles at 0 times s^2 / (s + 1)^2."""
        g = self.gain / (self.lag * s[:, None, None] + 1) * np.exp(-s[:, None, None] * self.dead)
        c = self.control * (1 + self.rate / s[:, None])
        return np.linalg.det(np.eye(2) + g * c[:, None, :]) * (s / (s + 1)) ** 2

    def crossings(self, channel):
        """Frequencies with |L| = 1, and those where L is negative, refined in 50 digits."""
        values = self.loop(channel, 1j * GRID)
        with mpmath.workdps(DIGITS):

            def exact(w):
                return self.loop(channel, mpmath.mpc(0, w), mpmath.exp)

            unit = self._roots(lambda w: abs(exact(w)) - 1, np.abs(values) - 1)
            real = self._roots(lambda w: mpmath.im(exact(w)), values.imag)
            points = [(float(w), float(mpmath.re(exact(w)))) for w in real]
        return [float(w) for w in unit], [(w, x) for w, x in points if x < 0]

    @staticmethod
    def _roots(function, values):
        return [
            mpmath.findroot(function, (GRID[k], GRID[k + 1]), solver="anderson")
            for k in np.flatnonzero(np.diff(np.sign(values)))
        ]

    def is_stable(self):
        """No zeros of the determinant right of the axis, by its turns; the plant is stable."""
        s = 1j * GRID
        turned = np.angle(self.determinant(s)[1:] / self.determinant(s)[:-1])
        assert np.abs(turned).max() < 1
        start, end = self.determinant(s[[0, -1]])
        start *= np.sign(start.real)  # real at 0, of either sign
        return round((turned.sum() + np.angle(start) - np.angle(end)) / np.pi) == 0


def loop_of(seed):
    """A random loop in a unit of time from 1e-6 to 1e6 s."""
    rng = np.random.default_rng(seed)
    gain = rng.uniform(0.2, 2.0, (2, 2)) * rng.choice([-1, 1], (2, 2))
    gain[[0, 1], [0, 1]] = np.abs(gain[[0, 1], [0, 1]]) + 0.5
    lag, dead = 10 ** rng.uniform(-0.5, 0.5, (2, 2)), 10 ** rng.uniform(-1, 0, (2, 2))
    control, rate = 10 ** rng.uniform(-1, 0.4, 2), 10 ** rng.uniform(-1, 0, 2)
    return TwoByTwo(gain, lag, dead, control, rate, float(10.0 ** rng.integers(-6, 7)))
