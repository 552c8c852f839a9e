"""A sampled controller around a continuous plant: stability and margins, recomputed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, root

from workbench.arrays import ComplexArray, RealArray
from workbench.certify.stability import stability_of
from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.input_checks import is_real, need_positive
from workbench.synthesis.implementation.sampled_response import SampledLoop
from workbench.systems.conversion import as_system
from workbench.systems.realisation import realisation

STATIC = 1e-8
"""Share of the lowest frequency at which the static gain is read."""
REAL = 1e-3
"""Imaginary part of a static gain, relative to the real one: with an integrator it is larger."""
SETTLED = 1e-10
"""Relative change at which the search for a delay margin ends."""
FRACTIONS = tuple(k / 12 for k in range(12))
"""Delays [samples] from whose crossovers that search begins."""
STEP, SCANNED = 0.05, 10.0
"""Delays [samples] at which the poles are looked at, and up to which."""
REACH = 1.1
"""Factor on a lag within which, and a sample, its delay is."""
LONGEST = 1000
"""Delay of the computer [samples], each a state of the loop for every control."""
CRITICAL = 1e-6
"""Distance of log L from -1 at which it has found one."""


@dataclass(frozen=True, eq=False)
class Margins:
    """What the loop of one control signal bears while the others stay closed.

    gain          factors below and above 1 between which the loop stays stable;
    phase         [deg], either way, infinite where the gain never passes 1; at `phase_at` [rad/s];
    delay         [samples] that may be added before the signal acts, in fractions too; the held
                  plant is taken anew for each. Infinite where the gain never passes 1; NaN, not
                  known but above `SCANNED`, where it does so for some fractions of a sample only,
                  none of which was found critical.
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
    plant: Any, K: Any, sample_time: float, delay: float = 0.0, *, sign: int = -1
) -> SampledConditions:
    """Stability and margins of a plant whose inputs are held, its outputs sampled, by K.

    Parameters
    ----------
    plant
        StateSpace or TransferFunction u -> y, continuous time; discretised exactly.
    K
        StateSpace or TransferFunction, sampled every `sample_time` [s].
    delay
        Of the computer [samples], any number from 0.
    sign
        u = sign K y: -1 negative, 1 positive feedback.

    Raises
    ------
    InputError
        A plant that is sampled, a K that is not or has another time or size, a bad sign or delay.
    """
    plant, K = as_system(plant, "plant"), as_system(K, "K")
    if plant.dt:
        raise InputError(f"the plant is sampled (dt = {plant.dt}); give the continuous plant")
    need_positive(sample_time, "sample_time")
    if K.dt not in (None, True) and not math.isclose(K.dt, sample_time):
        raise InputError(
            f"K has dt = {K.dt}; it must be sampled every {sample_time} s, as discretised() does"
        )
    need_fitting(K, plant)
    if sign not in (-1, 1):
        raise InputError(f"sign is {sign!r}; it must be -1 or 1")
    if not (is_real(delay) and 0.0 <= delay <= LONGEST):
        raise InputError(f"delay is {delay!r}; it must be a number of samples from 0 to {LONGEST}")
    sampled_K = realisation((K.A, K.B, K.C, K.D), sample_time)
    loop = SampledLoop(plant, sampled_K, sample_time, delay, sign)
    closed = loop.closed()
    poles = closed.poles()
    pole = complex(poles[np.argmax(np.abs(poles))]) if len(poles) else 0j
    if not stability_of(closed).holds:
        return SampledConditions(False, pole, ())
    return SampledConditions(True, pole, tuple(_margins(loop, i) for i in range(plant.ninputs)))


def need_fitting(K: StateSpace, plant: StateSpace) -> None:
    """Raise InputError for a controller of another size than the plant's outputs and inputs."""
    if (K.ninputs, K.noutputs) != (plant.noutputs, plant.ninputs):
        raise InputError(
            f"K has {K.ninputs} inputs and {K.noutputs} outputs; the plant has {plant.noutputs} "
            f"outputs and {plant.ninputs} inputs"
        )


def _margins(loop: SampledLoop, channel: int) -> Margins:
    angle = loop.angles()

    def at(x: float) -> complex:
        return complex(loop.gain(np.array([x]), channel)[0])

    L = loop.gain(angle, channel)
    real = [*_crossings(angle, L.imag, lambda x: at(x).imag), math.pi]
    start = at(STATIC * angle[0])
    if abs(start.imag) <= REAL * abs(start.real):  # no integrator
        real.append(STATIC * angle[0])
    values = np.array([at(x).real for x in real])
    factors = -1.0 / values[values < 0.0]
    gain = (
        float(factors[factors < 1.0].max(initial=0.0)),
        float(factors[factors > 1.0].min(initial=math.inf)),
    )
    delay = _delay_margin(loop, channel, angle)
    passing = _crossings(angle, _level(L), lambda x: math.log(abs(at(x))))
    if not passing:
        return Margins(gain, math.inf, math.nan, delay)
    away = np.abs(np.angle([-at(x) for x in passing]))
    least = int(np.argmin(away))
    return Margins(gain, math.degrees(away[least]), passing[least] / loop.period, delay)


def _delay_margin(loop: SampledLoop, channel: int, grid: RealArray) -> float:
    """The least delay [samples] that makes the loop critical, L(angle, delay) = -1.

    Fractions of a sample change the gain of the held plant, so that the crossovers of some of
    them, and the lags at which a pure delay would do there, are where the search begins.
    """
    starts: list[tuple[float, float]] = []
    for more in FRACTIONS:
        L = loop.gain(grid, channel, more)
        places = np.flatnonzero(np.diff(np.sign(_level(L))))
        lags = more + np.mod(np.angle(-L[places]), 2 * math.pi) / grid[places]
        starts += list(zip(lags.tolist(), grid[places].tolist(), strict=True))

    def away(unknowns: RealArray) -> list[float]:
        angle, more = math.exp(unknowns[0]), max(unknowns[1], 0.0)
        L = complex(loop.gain(np.array([angle]), channel, more)[0])
        return [math.log(abs(L)), float(np.angle(-L))]

    found: list[float] = []
    for lag, angle in sorted(starts):
        if found and lag > 1.0 + REACH * min(found):
            break
        solution = root(away, [math.log(angle), lag], tol=SETTLED)
        near = 0.0 < solution.x[1] < 1.0 + REACH * lag
        if near and np.abs(solution.fun).max() <= CRITICAL:
            found.append(float(solution.x[1]))
    least = min(found, default=math.nan if starts else math.inf)
    earlier = _unstable_from(loop, channel, SCANNED if math.isnan(least) else min(least, SCANNED))
    return least if earlier is None else earlier


def _unstable_from(loop: SampledLoop, channel: int, end: float) -> float | None:
    """The delay [samples] before `end` at which a pole leaves the unit circle; None if none does.

    It finds what lies between the fractions: modes near half the sampling rate or beyond come and
    go with the delay.
    """
    own = np.eye(loop.plant.ninputs)[channel]

    def outside(more: float) -> float:
        return float(np.abs(loop.closed(more * own).poles()).max(initial=0.0)) - 1.0

    for more in np.arange(STEP, end * (1.0 - STEP), STEP):
        if outside(more) >= 0.0:
            return float(brentq(outside, more - STEP, more, xtol=SETTLED))
    return None


def _level(L: ComplexArray) -> RealArray:
    with np.errstate(divide="ignore"):
        level: RealArray = np.log(np.abs(L))
    return level


def _crossings(x: RealArray, values: RealArray, of: Any) -> list[float]:
    """Where a function with these values changes its sign."""
    places = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
    return [float(brentq(of, x[i], x[i + 1], xtol=1e-15)) for i in places]
