"""Demands on a loop in the words of its user, and the weight that expresses each one.

The loop is u = K e, e = r - y, y = G u, with S = 1 / (1 + G K) and T = 1 - S. A weight W of a
transfer function X requires |W X| <= 1 at every frequency. Some weights are necessary or sufficient
for the demand. Others are exact for the simplest loop only, and a simulation of the loop shows
whether the demand is met: with integrators and unstable poles, slow poles may remain, and times
were found up to 2.4 times as long as those demanded. w is the angular frequency [rad/s], z the
damping that belongs to the overshoot.

    bandwidth       |S| <= w / w_b at low frequencies and 2 at high ones: W = (s / 2 + w_b) / s.
    settling_time   As a bandwidth of log(50) / t. S = s / (s + a), which settles to 2 % within
                    log(50) / a, keeps it for w_b = a; and S of two poles of damping z, with an
                    envelope of exp(-z w_0 t) and |S| = 2 z w / w_0 at low frequencies, for
                    w_b = log(50) / (2 z^2 t).
    overshoot       |T| <= M with M = 1 / (2 z sqrt(1 - z^2)), the peak of two poles of damping z,
                    whose overshoot is exp(-pi z / sqrt(1 - z^2)); M is 1 from a damping of 0.71 on,
                    where an overshoot of 4 % is left. Well below the bandwidth T is near 1 in any
                    case: the weight falls below 0.3 of it. Every loop around an unstable plant
                    overshoots, so this plant gets no such weight: a filter of the set-point limits
                    the overshoot (`setpoint_time_constant`).
    recovery_time   |G S| <= |G(j w_d)| w / w_d, as a bandwidth on |S| times |G| over |G(j w_d)|: so
                    slow poles of the plant may not stay in its answer to a step at its input, where
                    S does not show them. The answer k t exp(-a t) is down to a tenth of its peak at
                    t = 4.89 / a, hence w_d = 4.89 / t. |G| is that of the nominal.
    effort          |K S| <= 1 / effort, and less beyond a corner.
    control_rms     |K S| <= control_rms / noise. Sufficient: white noise with the rms n gives the
                    control an rms of at most n times the largest |K S|.
    control_range   |K S| <= control_range / setpoint_step. Necessary at w = 0, since u ends at
                    step / G(0), and at infinity, since u begins at step K(inf).

Sources: S. Skogestad, I. Postlethwaite, Multivariable Feedback Control, 2nd ed., Wiley 2005,
sections 2.4 (peaks of S and T, bandwidth, and steps) and 2.8 (weights); K. J. Astrom, R. M. Murray,
Feedback Systems, 2nd ed., Princeton 2021, section 7.3 (two poles) and chapter 12 (the four transfer
functions S, T, G S and K S, and steps at the input).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.input_checks import is_real, need_positive

Channel = Literal["S", "T", "KS"]
"""Transfer functions of a loop that have weights."""
SETTLED = 0.02
"""A loop has settled within this distance from the set-point, relative to the step."""
RECOVERED = 0.1
"""A loop has recovered from a step at its input within this share of the largest deviation."""
RECOVERY_DECAY = 4.8897
"""The x > 1 with x exp(1 - x) = `RECOVERED`."""
SLOW = 1e-3
"""Pole of the bandwidth's weight, relative to the bandwidth: |S| may have this size at frequency
zero.
"""
PEAK_SENSITIVITY = 2.0
"""Largest |S| that a bandwidth allows."""
BELOW_CROSSOVER = 0.3
"""Corner below which the weight of an overshoot decreases, relative to the bandwidth."""
ABOVE_CROSSOVER, UP_TO_SAMPLING = 20.0, 0.6
"""The corner of the effort's weight is the first number times the bandwidth, but at most the second
number over the sampling time, which is a fifth of half the sampling rate."""
NO_PEAK = 1 / math.sqrt(2)
"""Damping from which on T of two poles has no peak; also the damping assumed if no overshoot is
demanded.
"""


class Kind(NamedTuple):
    """The words for a demand, its unit, and whether a smaller number is harder to meet."""

    words: str
    unit: str
    harder_if_small: bool


KINDS = {
    "bandwidth": Kind("bandwidth", "rad/s", False),
    "settling_time": Kind("settling time of a step", "s", True),
    "overshoot": Kind("overshoot of a step", "1", True),
    "recovery_time": Kind("recovery from a step at the input", "s", True),
    "effort": Kind("weight of the control", "1", False),
    "control_rms": Kind("rms of the control by noise", "u", True),
    "control_range": Kind("control of a step", "u", True),
}
"""Every demand by the name of its field."""


class DemandWeight(NamedTuple):
    """Weight W of a channel X = S, T or K S: the demand ``name`` becomes |W X| <= 1.

    Among weights of the same ``shape``, the one with the largest ``size`` implies the others.
    """

    name: str
    channel: Channel
    W: Rational
    shape: str
    size: float


@dataclass(frozen=True, kw_only=True)
class Demands:
    """Demands on a loop; None leaves a demand out.

    Parameters
    ----------
    bandwidth
        Frequency [rad/s] below which errors are small: |S| <= omega / bandwidth.
    settling_time
        Time [s] after which a step of the set-point has settled to 2 %.
    overshoot
        Overshoot after a step of the set-point, relative to the step; 0 for no overshoot.
    recovery_time
        Time [s] after a step at the plant's input until the deviation stays below a tenth of its
        peak.
    effort
        Weight of the control at low frequencies: |K S| <= 1 / effort.
    control_rms
        Largest rms [units of u] of the control that measurement noise causes.
    control_range
        Largest deviation of the control [units of u] from the working point after a step of the
        set-point.
    noise
        Rms [units of y] of the measurement noise, white at the sampling rate.
    setpoint_step
        Step of the set-point [units of y] for which `control_range` holds.

    Raises
    ------
    InputError
        A number is not positive (an overshoot may be 0 and must be below 1); `control_rms` without
        `noise`, or `control_range` without `setpoint_step`.

    Examples
    --------
    >>> from workbench.synthesis import Demands
    >>> demands = Demands(bandwidth=2.0, overshoot=0.1, control_range=10.0, setpoint_step=4.0)
    >>> demands.asked
    ('bandwidth', 'overshoot', 'control_range')
    >>> demands.loosened("bandwidth", 2.0).bandwidth
    1.0
    """

    bandwidth: float | None = None
    settling_time: float | None = None
    overshoot: float | None = None
    recovery_time: float | None = None
    effort: float | None = None
    control_rms: float | None = None
    control_range: float | None = None
    noise: float = 0.0
    setpoint_step: float = 0.0

    def __post_init__(self) -> None:
        for name in KINDS:
            if name != "overshoot":
                need_positive(getattr(self, name), name, or_none=True)
        if self.overshoot is not None and not (
            is_real(self.overshoot) and 0.0 <= self.overshoot < 1.0
        ):
            raise InputError(
                f"overshoot is {self.overshoot!r}; it must be a share of the step, at least 0 and "
                "below 1 (0.1 is 10 %)"
            )
        for name, other in (("control_rms", "noise"), ("control_range", "setpoint_step")):
            value = getattr(self, other)
            if not (is_real(value) and 0.0 <= value < math.inf):
                raise InputError(f"{other} is {value!r}; it must be a number of at least 0")
            if getattr(self, name) is not None and not value:
                raise InputError(f"{name} is demanded; it needs {other}, which is 0")

    @property
    def asked(self) -> tuple[str, ...]:
        """Names of the demands that are given."""
        return tuple(name for name in KINDS if getattr(self, name) is not None)

    @property
    def damping(self) -> float:
        """Damping of two poles with the demanded overshoot; 0.71 where no overshoot is demanded."""
        if self.overshoot is None:
            return NO_PEAK
        if not self.overshoot:
            return 1.0
        decay = -math.log(self.overshoot)
        return decay / math.hypot(math.pi, decay)

    @property
    def crossover(self) -> float:
        """The largest bandwidth [rad/s] demanded, directly or by a time; 0 where none is
        demanded.
        """
        found = [self.bandwidth or 0.0]
        if self.settling_time is not None:
            found.append(_settling_bandwidth(self.settling_time, self.damping))
        if self.recovery_time is not None:
            found.append(RECOVERY_DECAY / self.recovery_time)
        return max(found)

    def loosened(self, name: str, factor: float) -> Demands:
        """The demands with one of them loosened by a factor.

        For an overshoot the factor multiplies the peak of T. Raises InputError if `name` is not
        demanded, or for a factor below 1.
        """
        self._need(name)
        if not (is_real(factor) and 1.0 <= factor < math.inf):
            raise InputError(f"factor is {factor!r}; a demand is loosened by a factor of 1 or more")
        value = getattr(self, name)
        if factor == 1.0:
            return self
        if name == "overshoot":
            value = _overshoot_of(factor * _peak(self.damping))
        else:
            value *= factor if KINDS[name].harder_if_small else 1 / factor
        return replace(self, **{name: value})

    def weights(
        self, nominal: Rational, dt: float, *, beside: Demands | None = None
    ) -> tuple[DemandWeight, ...]:
        """The weight of each demand; an overshoot has none if the plant is unstable.

        Parameters
        ----------
        nominal
            The plant.
        dt
            Sampling time [s] of the controller.
        beside
            Demands that give the crossover and the damping of the loop; None for these demands.

        Raises
        ------
        InputError
            An overshoot is demanded, but neither a bandwidth nor a time.
        """
        need_positive(dt, "dt")
        told = self if beside is None else beside
        found = (self._weight(name, nominal, dt, told) for name in self.asked)
        return tuple(one for one in found if one is not None)

    def _weight(
        self, name: str, nominal: Rational, dt: float, told: Demands
    ) -> DemandWeight | None:
        value = float(getattr(self, name))
        if name == "bandwidth":
            return DemandWeight(name, "S", tracking(value), "S", value)
        if name == "settling_time":
            omega = _settling_bandwidth(value, told.damping)
            return DemandWeight(name, "S", tracking(omega), "S", omega)
        if name == "overshoot":
            gain, corner = 1 / _peak(self.damping), BELOW_CROSSOVER * told.crossover
            if not corner:
                raise InputError(
                    "the weight of an overshoot needs a bandwidth: demand a bandwidth, a settling "
                    "time or a recovery time too"
                )
            if (nominal.poles.real > 0).any():
                return None
            return DemandWeight(name, "T", rational_of([0.0], [-corner], gain), "T", gain)
        if name == "recovery_time":
            omega = RECOVERY_DECAY / value
            return DemandWeight(name, "S", _recovery(nominal, omega), "GS", omega)
        if name == "effort":
            fast = ABOVE_CROSSOVER * told.crossover or math.inf
            corner = min(fast, UP_TO_SAMPLING / dt)
            W = rational_of([-corner], [-100 * corner], 100 * value)
            return DemandWeight(name, "KS", W, "effort", value)
        over = self.noise if name == "control_rms" else self.setpoint_step
        return DemandWeight(name, "KS", rational_of([], [], over / value), "KS", over / value)

    def only(self, names: Collection[str]) -> Demands:
        """Only the demands with these names. Raises InputError for a name that is not demanded."""
        for name in names:
            self._need(name)
        left_out: dict[str, Any] = dict.fromkeys(set(self.asked) - set(names))
        return replace(self, **left_out)

    def _need(self, name: str) -> None:
        if name not in self.asked:
            raise InputError(f"{name!r} is not demanded; demanded are {', '.join(self.asked)}")


def rational_of(zeros: Sequence[Any], poles: Sequence[Any], gain: float) -> Rational:
    """A rational function with lists of zeros and poles, and a gain."""
    return Rational(np.array(zeros, complex), np.array(poles, complex), gain)


def strictest(weights: Collection[DemandWeight]) -> list[DemandWeight]:
    """The weights without those that another one of the same shape implies."""
    found: dict[str, DemandWeight] = {}
    for one in weights:
        if one.shape not in found or one.size > found[one.shape].size:
            found[one.shape] = one
    return list(found.values())


def tracking(omega: float) -> Rational:
    """The weight (s / 2 + omega) / (s + omega / 1000) of S, for the bandwidth omega [rad/s]."""
    return rational_of([-PEAK_SENSITIVITY * omega], [-SLOW * omega], 1 / PEAK_SENSITIVITY)


def _recovery(nominal: Rational, omega: float) -> Rational:
    """The weight of S that bounds G S. Like every weight it is stable and has no zeros right of the
    axis.

    Poles near the axis, such as integrators, are moved as far from it as the pole of `tracking`.
    """
    own, least = tracking(omega), SLOW * omega
    poles, zeros = (_mirrored_left(roots, least) for roots in (nominal.poles, nominal.zeros))
    outer = Rational(zeros, poles, abs(nominal.gain))
    gain = own.gain * outer.gain / float(np.abs(outer.response(np.array([omega]))[0]))
    return rational_of([*own.zeros, *zeros], [*own.poles, *poles], gain)


def _mirrored_left(roots: np.ndarray, least: float) -> np.ndarray:
    """The roots mirrored to the left of the imaginary axis, at least `least` away from it."""
    return -np.maximum(np.abs(roots.real), least) + 1j * roots.imag


def _settling_bandwidth(time: float, damping: float) -> float:
    """Bandwidth [rad/s] for which a step settles within a time [s]."""
    return -math.log(SETTLED) / (min(2 * damping**2, 1.0) * time)


def _peak(damping: float) -> float:
    """Peak of |T| of two poles with this damping."""
    return 1.0 if damping >= NO_PEAK else 1 / (2 * damping * math.sqrt(1 - damping**2))


def _overshoot_of(peak: float) -> float:
    """Overshoot of a loop with two poles whose |T| has this peak, which is above 1."""
    # z^2 from 4 z^2 (1 - z^2) = 1 / peak^2, in a form without cancellation
    square = 0.5 / (peak**2 * (1 + math.sqrt(1 - peak**-2)))
    return math.exp(-math.pi * math.sqrt(square / (1 - square)))
