"""Stability and margins of a sampled controller around a continuous plant."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, root

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.answer import REPEATED_ROUNDING, Answer
from workbench.certificate import Check, Checker, relative_excess
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.input_checks import is_real, need_positive
from workbench.second_opinion.loops import powers_fall
from workbench.second_opinion.peaks import one_unstable
from workbench.synthesis.implementation.sampled_response import HeldPlantLoop
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.range_hints import warn_far_period
from workbench.systems.realisation import realisation

STATIC_FREQUENCY_SHARE = 1e-8
"""The static gain is computed at this share of the lowest frequency of the grid."""
REAL_GAIN_TOLERANCE = 1e-3
"""A static gain counts as real if its imaginary part is below this share of its real part. With an
integrator the imaginary part is larger.
"""
DELAY_TOLERANCE = 1e-10
"""Accuracy of the search for a delay margin [samples]."""
STARTING_DELAYS = tuple(k / 12 for k in range(12))
"""Delays [samples] at whose crossover frequencies the search for a delay margin starts."""
SCAN_STEP, LONGEST_SCANNED = 0.05, 10.0
"""Step between the delays [samples] at which the poles are computed, and the longest of them."""
LAG_REACH = 1.1
"""A critical delay lies within this factor of the lag that it starts from, plus one sample."""
LONGEST_DELAY = 1000
"""Longest computation delay [samples]; each sample adds a state for every control."""
CRITICAL_TOLERANCE = 1e-6
"""Largest distance of log L from log(-1) at which a delay counts as critical."""


@dataclass(frozen=True, eq=False)
class SampledMargins:
    """Stability margins of the loop of one control signal while the other loops stay closed.

    Unlike `ClassicalMargins`, it is of a controller on a computer, with delays in samples and a
    hold.

    gain          factors below and above 1 between which the loop stays stable;
    phase_deg         margin [deg] in both directions, at `phase_at` [rad/s]; infinite where the
                  gain never passes 1;
    delay_samples         time [samples], also fractions, that may be added before the signal acts;
                  the held plant is discretised again for each delay. Infinite where the gain never
                  passes 1. NaN means not known but above `LONGEST_SCANNED`: the gain passes 1 for
                  some fractions of a sample only, and none of these was found critical.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import sampled_conditions
    >>> K = control.tf([10.0], [1.0], 0.1)
    >>> margins = sampled_conditions(control.tf([1.0], [1.0, 0.0]), K, 0.1).margins[0]
    >>> round(margins.phase_deg, 4), round(margins.delay_samples, 4)
    (60.0, 1.0)
    """

    gain: tuple[float, float]
    phase_deg: float
    phase_at: float
    delay_samples: float

    @property
    def numbers(self) -> tuple[float, ...]:
        """All margins as a tuple of numbers."""
        return *self.gain, self.phase_deg, self.phase_at, self.delay_samples


@dataclass(frozen=True, eq=False, repr=False)
class SampledConditions(Answer):
    """Stability of a sampled loop, its pole of largest modulus, and its margins.

    ``margins`` has an entry for each control signal; it is empty for an unstable loop.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import sampled_conditions
    >>> found = sampled_conditions(
    ...     control.tf([1.0], [1.0, 0.0]), control.tf([10.0], [1.0], 0.1), 0.1
    ... )
    >>> round(abs(found.pole), 6)  # 1 - 10 * 0.1
    0.0
    """

    stable: bool
    pole: complex
    margins: tuple[SampledMargins, ...]

    def summary(self) -> str:
        state = "stable" if self.stable else "UNSTABLE"
        lines = [f"SampledConditions: {state}, largest pole at z = {self.pole:.5g}"]
        for number, one in enumerate(self.margins):
            low, high = one.gain
            lines.append(
                f"  control {number + 1}: gain {low:.4g} to {high:.4g}, phase {one.phase_deg:.4g} "
                f"degrees, delay {one.delay_samples:.4g} samples"
            )
        return "\n".join(lines)


def sampled_conditions(
    plant: Any, controller: Any, dt: float, *, delay_samples: float = 0.0, sign: int | None = None
) -> SampledConditions:
    """Stability and margins of a sampled controller K around a plant with held inputs.

    Parameters
    ----------
    plant
        A continuous-time system from u to y, or a model, whose nominal is used; it is discretised
        exactly. For a `GeneralisedPlant` it is the part from controls to measurements.
    controller
        Controller, StateSpace or TransferFunction, sampled every `dt` [s].
    delay_samples
        Computation delay [samples], 0 or more; it may be fractional.
    sign
        Sign in u = sign K y. With None it is u = K y for a generalised plant, whose sums contain
        the signs, and u = -K y for a plant, as in `control.feedback`.

    Raises
    ------
    InputError
        The plant is sampled; K is not, or has another sampling time or size; or the sign or the
        delay is wrong.

    Warns
    -----
    RangeWarning
        The sampling time is above 100 times the plant's longest time constant, or below 1/1000
        of the sampled loop's shortest.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import sampled_conditions
    >>> found = sampled_conditions(
    ...     control.tf([1.0], [1.0, 0.0]), control.tf([10.0], [1.0], 0.1), 0.1
    ... )
    >>> found.stable, round(found.margins[0].gain[1], 4)  # unstable from 2 / (10 * 0.1) on
    (True, 2.0)
    """
    plant, sign = plant_and_sign(plant, sign)
    controller = as_system(controller, "controller")
    if plant.dt:
        raise InputError(f"the plant is sampled (dt = {plant.dt}); give the continuous plant")
    need_positive(dt, "dt")
    need_same_time(controller, dt)
    need_fitting(controller, plant)
    need_delay(delay_samples)
    sampled_K = realisation((controller.A, controller.B, controller.C, controller.D), dt)
    loop = HeldPlantLoop(plant, sampled_K, dt, delay_samples, sign)
    closed = loop.closed()
    warn_far_period(dt, plant, closed)
    poles = closed.poles()
    pole = complex(poles[np.argmax(np.abs(poles))]) if len(poles) else 0j
    if not stability_check(closed).holds:
        return SampledConditions(False, pole, ()).with_checker(SampledChecker(loop))
    margins = tuple(_margins(loop, i) for i in range(plant.ninputs))
    return SampledConditions(True, pole, margins).with_checker(SampledChecker(loop))


@dataclass(frozen=True, eq=False)
class SampledChecker(Checker):
    """Checks `SampledConditions` of a loop; its margins are computed again."""

    loop: HeldPlantLoop

    @property
    def quantifier(self) -> str:
        return "for this one loop, at its samples"

    def checks(self, answer: SampledConditions, tolerance: float) -> list[Check]:
        stability = stability_check(self.loop.closed())
        other = float(stability.holds != answer.stable)
        found = [Check("stability", "whether it is not as claimed", other, 0.0)]
        again = [_margins(self.loop, i) for i in range(len(answer.margins))]
        statement = "largest difference of margins from those computed again, relative"
        apart = [
            relative_excess(max(abs(a), abs(b)), min(abs(a), abs(b)))
            for one, other in zip(answer.margins, again, strict=True)
            for a, b in zip(one.numbers, other.numbers, strict=True)
            if not (math.isnan(a) and math.isnan(b))
        ]
        return [*found, Check("margins", statement, max(apart, default=0.0), REPEATED_ROUNDING)]

    def second_opinion(self, answer: SampledConditions) -> list[Check]:
        closed = self.loop.closed()
        return [powers_fall(closed.A, closed.dt) if answer.stable else one_unstable([closed])]


def what_stabilises(
    plant: StateSpace, K: StateSpace, sample_time: float, delay: float, sign: int
) -> str:
    """Advice on an unstable loop u = sign K y: the other sign, if the loop is stable with it."""
    if sampled_conditions(plant, K, sample_time, delay_samples=delay, sign=-sign).stable:
        turned = "u = -K y" if sign > 0 else "u = K y"
        return f"with the other sign, {turned}, it is stable: give sign={-sign}, or change K's sign"
    return "sample faster or lower the bandwidth"


def plant_and_sign(plant: Any, sign: int | None) -> tuple[StateSpace, int]:
    """The plant from controls to measurements, and the sign of the loop, as in
    `sampled_conditions`.

    Raises InputError if a sign is given for a generalised plant.
    """
    if isinstance(plant, GeneralisedPlant):
        if sign is not None:
            raise InputError(
                f"sign is {sign!r}; a generalised plant has its signs in its sums: leave it out"
            )
        return plant.controlled(), 1
    if sign not in (None, -1, 1):
        raise InputError(f"sign is {sign!r}; it must be -1 or 1")
    return as_system(plant, "plant"), -1 if sign is None else sign


def need_delay(delay: float) -> None:
    """Raise InputError unless a computation delay [samples] is valid."""
    if not (is_real(delay) and 0.0 <= delay <= LONGEST_DELAY):
        raise InputError(
            f"delay_samples is {delay!r}; it must be a number of samples from 0 to {LONGEST_DELAY}"
        )


def need_same_time(K: StateSpace, sample_time: float) -> None:
    """Raise InputError if the controller has another sampling time or is continuous."""
    if K.dt not in (None, True) and not math.isclose(K.dt, sample_time):
        raise InputError(
            f"controller has dt = {K.dt}; it must be sampled every {sample_time} s, as "
            "discretised() does"
        )


def need_fitting(K: StateSpace, plant: StateSpace) -> None:
    """Raise InputError unless the controller has as many inputs as the plant has outputs, and vice
    versa.
    """
    if (K.ninputs, K.noutputs) != (plant.noutputs, plant.ninputs):
        raise InputError(
            f"controller has {K.ninputs} inputs and {K.noutputs} outputs; the plant has "
            f"{plant.noutputs} outputs and {plant.ninputs} inputs"
        )


def _margins(loop: HeldPlantLoop, channel: int) -> SampledMargins:
    """Margins of one control signal of a stable loop."""
    angle = loop.angles()

    def at(x: float) -> complex:
        return complex(loop.gain(np.array([x]), channel)[0])

    L = loop.gain(angle, channel)
    real = [*_crossings(angle, L.imag, lambda x: at(x).imag), math.pi]
    start = at(STATIC_FREQUENCY_SHARE * angle[0])
    if abs(start.imag) <= REAL_GAIN_TOLERANCE * abs(start.real):  # there is no integrator
        real.append(STATIC_FREQUENCY_SHARE * angle[0])
    values = np.array([at(x).real for x in real])
    factors = -1.0 / values[values < 0.0]
    gain = (
        float(factors[factors < 1.0].max(initial=0.0)),
        float(factors[factors > 1.0].min(initial=math.inf)),
    )
    delay = _delay_margin(loop, channel, angle)
    passing = _crossings(angle, _level(L), lambda x: math.log(abs(at(x))))
    if not passing:
        return SampledMargins(gain, math.inf, math.nan, delay)
    away = np.abs(np.angle([-at(x) for x in passing]))
    least = int(np.argmin(away))
    return SampledMargins(gain, math.degrees(away[least]), passing[least] / loop.period, delay)


def _delay_margin(loop: HeldPlantLoop, channel: int, grid: RealArray) -> float:
    """The least additional delay [samples] for which the loop is critical, L(angle, delay) = -1.

    A fraction of a sample changes the gain of the held plant. The search therefore starts from the
    crossover frequencies for several fractions, and from the lags at which a pure delay would make
    the loop critical there.
    """
    starts: list[tuple[float, float]] = []
    for more in STARTING_DELAYS:
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
        if found and lag > 1.0 + LAG_REACH * min(found):
            break
        solution = root(away, [math.log(angle), lag], tol=DELAY_TOLERANCE)
        near = 0.0 < solution.x[1] < 1.0 + LAG_REACH * lag
        if near and np.abs(solution.fun).max() <= CRITICAL_TOLERANCE:
            found.append(float(solution.x[1]))
    least = min(found, default=math.nan if starts else math.inf)
    earlier = _unstable_from(
        loop, channel, LONGEST_SCANNED if math.isnan(least) else min(least, LONGEST_SCANNED)
    )
    return least if earlier is None else earlier


def _unstable_from(loop: HeldPlantLoop, channel: int, end: float) -> float | None:
    """The first delay [samples] below `end` at which a pole leaves the unit circle; None if none
    does.

    This finds critical delays between the starting fractions: modes near half the sampling rate or
    above become unstable at some delays only.
    """
    own = np.eye(loop.plant.ninputs)[channel]

    def outside(more: float) -> float:
        return loop.largest_pole(more * own) - 1.0

    for more in np.arange(SCAN_STEP, end * (1.0 - SCAN_STEP), SCAN_STEP):
        if outside(more) >= 0.0:
            return _zero(outside, more - SCAN_STEP, more, DELAY_TOLERANCE)
    return None


def _level(L: ComplexArray) -> RealArray:
    """The logarithm of |L|."""
    with np.errstate(divide="ignore"):
        level: RealArray = np.log(np.abs(L))
    return level


def _crossings(x: RealArray, values: RealArray, of: Any) -> list[float]:
    """Zeros of the function `of` between points x at which its `values` change sign."""
    places = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
    return [_zero(of, x[i], x[i + 1], 1e-15) for i in places]


def _zero(of: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """A zero of a function that changes its sign between two points, up to rounding.

    If rounding hides the change, the function is zero up to rounding at one of the ends.
    """
    ends = of(low), of(high)
    if ends[0] * ends[1] >= 0.0:
        return float(low if abs(ends[0]) <= abs(ends[1]) else high)
    return float(brentq(of, low, high, xtol=tolerance))
