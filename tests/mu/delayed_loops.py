"""Random loops with dead time as engineers write them, and what is true of them in 50 digits.

Truth comes from a dense grid with refinement by mpmath, and from turns about 0 along the axis.
"""

from dataclasses import dataclass

import mpmath
import numpy as np

from workbench.uncertainty import delay, tf

DIGITS = 50
GRID = 6000
KINDS = ("lag", "integrator", "pi", "fopdt", "sopdt", "unstable", "resonance", "proper")


@dataclass(frozen=True)
class DelayedLoop:
    """num / den exp(-s T), coefficients highest first."""

    num: tuple
    den: tuple
    T: float

    @property
    def system(self):
        return tf(list(self.num), list(self.den)) * delay("tau", self.T, self.T)

    def rational(self, s):
        return mpmath.polyval(self.num, s) / mpmath.polyval(self.den, s)

    def __call__(self, omega):
        s = mpmath.mpc(0, omega)
        return self.rational(s) * mpmath.exp(-s * mpmath.mpf(self.T))

    def values(self, omega):
        s = 1j * omega
        return np.polyval(self.num, s) / np.polyval(self.den, s) * np.exp(-s * self.T)


def loop_of(seed):
    """A random loop of some kind, in a unit of time from 1e-6 to 1e6 s."""
    rng = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    k, a, b, T = (float(10 ** rng.uniform(-0.7, 0.7)) for _ in range(4))
    T *= 0.4
    num, den = {
        "lag": ([k], [1.0, a]),
        "integrator": ([0.4 * k], [1.0, 0.0]),
        "pi": (np.array([0.4 * k, 0.2 * k * b]), np.polymul([1.0, 0.0], [1 / a, 1.0])),
        "fopdt": ([3 * k], [1 / a, 1.0]),
        "sopdt": ([2 * k], np.polymul([1 / a, 1.0], [1 / b, 1.0])),
        "unstable": ([2 * k], [1.0, -0.3 * k]),
        "resonance": ([0.5 * k], np.polymul([1 / b**2, 0.1 / b, 1.0], [1.0, 0.0])),
        "proper": (np.array([0.5, k]), [1.0, a]),
    }[kind]
    unit = float(10 ** rng.uniform(-6, 6))
    scaled = [tuple(np.asarray(p) * unit ** np.arange(len(p))[::-1]) for p in (num, den)]
    return DelayedLoop(tuple(map(float, scaled[0])), tuple(map(float, scaled[1])), T * unit)


def crossings(loop):
    """Frequencies with |L| = 1, and with L < 0 up to some turns beyond, refined in 50 digits."""
    poles, zeros = np.roots(loop.den), np.roots(loop.num)
    sizes = np.abs(np.concatenate([poles, zeros, [1 / loop.T]]))
    speed = sizes[sizes > 0]
    omega = np.union1d(
        np.geomspace(speed.min() * 1e-3, speed.max() * 1e3, GRID),
        np.linspace(0, 30 / loop.T, GRID)[1:],
    )
    with mpmath.workdps(DIGITS):
        unit = _roots(lambda w: abs(loop(w)) - 1, np.abs(loop.values(omega)) - 1, omega)
        inside = omega[omega < 30 / loop.T]
        real = _roots(lambda w: mpmath.im(loop(w)), loop.values(inside).imag, inside)
        real = [w for w in real if mpmath.re(loop(w)) < 0]
    return unit, real


def _roots(function, values, omega):
    return [
        mpmath.findroot(function, (omega[k], omega[k + 1]), solver="anderson")
        for k in np.flatnonzero(np.diff(np.sign(values)))
    ]


def is_stable(loop):
    """Whether no closed-loop pole lies right of the axis, by turns of D + N exp(-s T) about 0."""
    corners = np.abs(np.concatenate([np.roots(loop.den), np.roots(loop.num), [1 / loop.T]]))
    end = 100 * corners.max()
    while np.abs(loop.values(np.array([end])))[0] > 0.6:
        end *= 2
    omega = np.union1d(np.linspace(0, end, 200_000), np.geomspace(end * 1e-9, end, 4000))
    s, order = 1j * omega / end, len(loop.den) - 1
    scale = end ** np.arange(order + 1.0)[::-1]
    num, den = loop.num * scale[-len(loop.num) :], loop.den * scale
    shown = np.polyval(den, s) + np.polyval(num, s) * np.exp(-s * end * loop.T)
    shown = shown / (s + corners.max() / end) ** order  # tends to a positive number times 1 + L
    steps = np.angle(shown[1:] / shown[:-1])
    assert np.abs(steps).max() < 1
    return round((steps.sum() - np.angle(shown[-1])) / np.pi) == 0
