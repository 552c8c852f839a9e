"""A sampled controller around a continuous plant: stability and margins, recomputed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from workbench.errors import InputError, SolverError
from workbench.simulation.discretise import sampled, split_delay
from workbench.synthesis.loops import stability_of
from workbench.synthesis.standard import Real, realisation
from workbench.uncertainty.connection import connected, part_of
from workbench.uncertainty.generalised import response

if TYPE_CHECKING:
    from control import StateSpace

Complex = NDArray[np.complex128]
POINTS = 4000
"""Frequencies between the slowest mode and half the sampling rate; more about each mode."""
ABOUT = np.concatenate([-np.logspace(2, -2, 25), [0.0], np.logspace(-2, 2, 25)])
"""Of a mode, in units of its damping."""
SETTLED = 1e-9
"""Change of the delay margin [samples] at which it is found."""


@dataclass(frozen=True, eq=False)
class Margins:
    """What the loop of one control signal bears while the others stay closed.

    gain          factors below and above 1 between which the loop stays stable;
    phase         [deg], either way, infinite where the gain never passes 1; at `phase_at` [rad/s];
    delay         [samples] that may be added before the signal acts, in fractions too.
    """

    gain: tuple[float, float]
    phase: float
    phase_at: float
    delay: float


@dataclass(frozen=True, eq=False)
class SampledConditions:
    """``pole`` is the closed loop's largest in modulus; ``margins`` of each control signal, if
    the loop is stable."""

    stable: bool
    pole: complex
    margins: tuple[Margins, ...]


def sampled_conditions(
    plant: Any, K: StateSpace, sample_time: float, delay: float = 0.0, *, sign: int = -1
) -> SampledConditions:
    """Stability and margins of a plant whose inputs are held, its outputs sampled, by K.

    Parameters
    ----------
    plant
        StateSpace or TransferFunction u -> y, continuous time; discretised exactly.
    K
        Sampled every `sample_time` [s].
    delay
        Of the computer [samples], any number from 0.
    sign
        u = sign K y: -1 negative, 1 positive feedback.

    Raises
    ------
    InputError
        A plant that is sampled, a K that is not or has another time or size, a bad sign or delay.
    SolverError
        A delay margin that is not found.
    """
    import control

    plant = control.ss(plant)
    if plant.dt:
        raise InputError(f"the plant is sampled (dt = {plant.dt}); give the continuous plant")
    if not 0.0 < sample_time < math.inf:
        raise InputError(f"sample_time is {sample_time} s; it must be positive and finite")
    if not K.dt or (K.dt is not True and not math.isclose(K.dt, sample_time)):
        raise InputError(f"K has dt = {K.dt}; it must be sampled every {sample_time} s")
    if (K.ninputs, K.noutputs) != (plant.noutputs, plant.ninputs):
        raise InputError(
            f"K has {K.ninputs} inputs and {K.noutputs} outputs; the plant has {plant.noutputs} "
            f"outputs and {plant.ninputs} inputs"
        )
    if sign not in (-1, 1):
        raise InputError(f"sign is {sign}; it must be -1 or 1")
    split_delay(delay)
    loop = _Loop(plant, realisation((K.A, K.B, K.C, K.D), sample_time), sample_time, delay, sign)
    closed = loop.closed
    poles = closed.poles()
    pole = complex(poles[np.argmax(np.abs(poles))]) if len(poles) else 0j
    if not stability_of(closed).holds:
        return SampledConditions(False, pole, ())
    return SampledConditions(True, pole, tuple(map(loop.margins, range(plant.ninputs))))


@dataclass(frozen=True, eq=False)
class _Loop:
    plant: StateSpace
    K: StateSpace
    period: float
    delay: float
    sign: int

    @property
    def closed(self) -> StateSpace:
        """The loop without inputs and outputs, with every state."""
        G = sampled(self.plant, self.period, self.delay)
        m, p = self.plant.ninputs, self.plant.noutputs
        links = np.zeros((m + p, p + m))
        links[:m, p:], links[m:, :p] = self.sign * np.eye(m), np.eye(p)
        # One signal each, for python-control systems have some.
        enters, leaves = np.eye(m + p, 1), np.eye(1, m + p)
        M, n = connected((part_of(G), part_of(self.K)), links, enters, leaves)
        return realisation((M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]), self.period)

    def angles(self) -> Real:
        """Frequencies [rad/sample] in (0, pi], dense where a mode makes the response steep."""
        G = sampled(self.plant, self.period, self.delay)
        modes = np.concatenate([s.poles() for s in (G, self.K, self.closed)]).astype(complex)
        modes = np.log(modes[np.abs(modes) > 1e-6])
        size = np.abs(modes)
        slowest = size[size > 1e-9].min(initial=math.pi)
        grid = np.geomspace(slowest / 100, math.pi, POINTS)
        damping = np.maximum(np.abs(modes.real), 1e-6 * size)
        near = np.abs(modes.imag)[:, None] + damping[:, None] * ABOUT
        near = near[(near > grid[0]) & (near < math.pi)]
        return np.unique(np.concatenate([grid, near]))

    def gain(self, angle: Real, channel: int, more: float = 0.0) -> Complex:
        """L of one signal (F,), -1 being critical, its delay raised by `more` [samples]."""
        m = self.plant.ninputs
        columns = []
        for j in range(m):
            whole, rest = split_delay(self.delay + (more if j == channel else 0.0))
            parts = self.plant.A, self.plant.B[:, [j]], self.plant.C, self.plant.D[:, [j]]
            held = sampled(realisation(parts, 0.0), self.period, rest)
            turned = np.exp(-1j * angle * whole)[:, None, None]
            columns.append(response(held, angle / self.period) * turned)
        L = -self.sign * response(self.K, angle / self.period) @ np.concatenate(columns, axis=-1)
        other = np.delete(np.arange(m), channel)
        own = L[:, channel, channel]
        if m == 1:
            return own
        others = np.eye(m - 1) + L[:, other[:, None], other]
        through = np.linalg.solve(others, L[:, other, channel, None])[..., 0]
        return own - (L[:, channel, other] * through).sum(axis=-1)

    def margins(self, channel: int) -> Margins:
        angle = self.angles()

        def at(x: float, more: float = 0.0) -> complex:
            return complex(self.gain(np.array([x]), channel, more)[0])

        L = self.gain(angle, channel)
        real = [*_crossings(angle, L.imag, lambda x: at(x).imag), math.pi]
        values = np.array([at(x).real for x in real] + [L[0].real])
        factors = -1.0 / values[values < 0.0]
        gain = (
            float(factors[factors < 1.0].max(initial=0.0)),
            float(factors[factors > 1.0].min(initial=math.inf)),
        )
        passing = _crossings(angle, np.log(np.abs(L)), lambda x: math.log(abs(at(x))))
        if not passing:
            return Margins(gain, math.inf, math.nan, math.inf)
        away = np.angle([-at(x) for x in passing])
        least = int(np.argmin(np.abs(away)))
        lag = np.mod(away, 2 * math.pi) / passing
        first = int(np.argmin(lag))
        delay = self._delay(channel, float(passing[first]), float(lag[first]))
        phase = math.degrees(abs(away[least]))
        return Margins(gain, phase, passing[least] / self.period, delay)

    def _delay(self, channel: int, angle: float, delay: float) -> float:
        """Where the crossover that a pure lag of `delay` makes critical is so for the held plant.

        Fractions of a sample change the sampled plant's gain, so that the crossover moves a little.
        """
        for _ in range(50):

            def level(x: float, more: float = delay) -> float:
                return math.log(abs(complex(self.gain(np.array([x]), channel, more)[0])))

            near = np.linspace(0.8 * angle, min(1.2 * angle, math.pi), 400)
            values = np.log(np.abs(self.gain(near, channel, delay)))
            found = _crossings(near, values, level)
            if not found:
                break
            angle = min(found, key=lambda x: abs(x - angle))
            L = complex(self.gain(np.array([angle]), channel, delay)[0])
            change = float(np.angle(-L)) / angle
            delay += change
            if abs(change) <= SETTLED * max(delay, 1.0):
                return delay
        raise SolverError(f"no delay margin found near {delay:.6g} samples")


def _crossings(x: Real, values: Real, of: Any) -> list[float]:
    """Where a function with these values changes its sign."""
    places = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
    return [float(brentq(of, x[i], x[i + 1], xtol=1e-15)) for i in places]
