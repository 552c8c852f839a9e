"""Demands on a loop in the words of its user, and the weight that each becomes.

The loop is u = K e, e = r - y, y = G u, with S = 1 / (1 + G K) and T = 1 - S. A weight W of a
transfer function X asks |W X| <= 1 at every frequency. Some weights are necessary or sufficient;
others are exact for the simplest loop that the words suit, and the simulated loop says whether the
words came true: beside integrators and unstable poles slow poles may stay, and times were found up
to 2.4 times as long as those demanded. w is the frequency, z the damping that belongs to the
overshoot.

    bandwidth       |S| <= w / w_b at low frequencies and 2 at high ones: W = (s / 2 + w_b) / s.
    settling_time   As a bandwidth of log(50) / t. S = s / (s + a), which settles to 2 % within
                    log(50) / a, keeps it for w_b = a; and S of two poles of damping z, with an
                    envelope of exp(-z w_0 t) and |S| = 2 z w / w_0 at low frequencies, for
                    w_b = log(50) / (2 z^2 t).
    overshoot       |T| <= M with M = 1 / (2 z sqrt(1 - z^2)), the peak of two poles of damping z,
                    whose overshoot is exp(-pi z / sqrt(1 - z^2)); M is 1 from a damping of 0.71 on,
                    where an overshoot of 4 % is left. Well below the bandwidth T is near 1 in any
                    case: the weight falls below 0.3 of it.
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
"""Transfer functions of a loop that weights act on."""
SETTLED = 0.02
"""Distance from the set-point, over the step, within which a loop has settled."""
RECOVERED = 0.1
"""Share of the largest deviation after a step at the input, within which a loop has recovered."""
RECOVERY_DECAY = 4.8897
"""The x > 1 at which x exp(1 - x) is `RECOVERED`."""
SLOW = 1e-3
"""Pole of the weight of a bandwidth over the bandwidth: |S| may be this at frequency zero."""
PEAK_SENSITIVITY = 2.0
"""Largest |S| that a bandwidth allows."""
BELOW_CROSSOVER = 0.3
"""Corner, over the bandwidth, below which the weight of an overshoot falls."""
ABOVE_CROSSOVER, UP_TO_SAMPLING = 20.0, 0.6
"""Corner of an effort's weight: this multiple of the bandwidth, but a fifth of half the sampling
rate at most, in rad / s times the sampling time."""
NO_PEAK = 1 / math.sqrt(2)
"""Damping from which on two poles have no peak of T, and that where no overshoot is demanded."""


class Kind(NamedTuple):
    """What a demand is called, its unit, and whether a smaller number is the harder one."""

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
    """A weight W of a channel: |W X| <= 1 is what the demand ``name`` becomes.

    Of weights of one ``shape`` that with the largest ``size`` includes the others.
    """

    name: str
    channel: Channel
    W: Rational
    shape: str
    size: float


@dataclass(frozen=True, kw_only=True)
class Demands:
    """What a loop is asked for; None leaves a demand out.

    Parameters
    ----------
    bandwidth
        Frequency [rad/s] below which errors are small: |S| <= omega / bandwidth.
    settling_time
        Time [s] after which a step of the set-point has settled to 2 %.
    overshoot
        Overshoot of a step of the set-point, over the step; 0: none.
    recovery_time
        Time [s] after which the deviation after a step at the input is below a tenth of its peak.
    effort
        Weight of the control at low frequencies: |K S| <= 1 / effort.
    control_rms
        Largest rms [units of u] of the control that measurement noise causes.
    control_range
        Largest control [units of u] of a step of the set-point, from the working point.
    noise
        Rms [units of y] of the measurement noise, white at the sampling rate.
    setpoint_step
        The step [units of y] that `control_range` is about.

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
                f"overshoot is {self.overshoot!r}; it must be a share of the step, from 0 to below "
                "1 (0.1 is 10 %)"
            )
        for name, other in (("control_rms", "noise"), ("control_range", "setpoint_step")):
            value = getattr(self, other)
            if not (is_real(value) and 0.0 <= value < math.inf):
                raise InputError(f"{other} is {value!r}; it must be a number of at least 0")
            if getattr(self, name) is not None and not value:
                raise InputError(f"{name} is demanded; it needs {other}, which is 0")

    @property
    def asked(self) -> tuple[str, ...]:
        """Names of what is demanded."""
        return tuple(name for name in KINDS if getattr(self, name) is not None)

    @property
    def damping(self) -> float:
        """Damping of two poles with the overshoot demanded; 0.71 where none is."""
        if self.overshoot is None:
            return NO_PEAK
        if not self.overshoot:
            return 1.0
        decay = -math.log(self.overshoot)
        return decay / math.hypot(math.pi, decay)

    @property
    def crossover(self) -> float:
        """The largest bandwidth [rad/s] that is demanded, also by times; 0 where none is."""
        found = [self.bandwidth or 0.0]
        if self.settling_time is not None:
            found.append(_settling_bandwidth(self.settling_time, self.damping))
        if self.recovery_time is not None:
            found.append(RECOVERY_DECAY / self.recovery_time)
        return max(found)

    def loosened(self, name: str, factor: float) -> Demands:
        """The demands with one number made easier by a factor.

        An overshoot is made so by the peak of T that belongs to it. Raises InputError where it is
        not demanded, or for a factor below 1.
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
        """The weight of each demand.

        Parameters
        ----------
        nominal
            The plant.
        dt
            Sampling time [s] of the controller.
        beside
            Demands that tell where the loop crosses over and how it is damped; None: these.

        Raises
        ------
        InputError
            An overshoot is demanded, and nothing that tells a bandwidth.
        """
        need_positive(dt, "dt")
        told = self if beside is None else beside
        return tuple(self._weight(name, nominal, dt, told) for name in self.asked)

    def _weight(self, name: str, nominal: Rational, dt: float, told: Demands) -> DemandWeight:
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
                    "an overshoot belongs to a loop of some speed: demand a bandwidth, a settling "
                    "time or a recovery time too"
                )
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
        """The demands of these names alone. Raises InputError for one that is not demanded."""
        for name in names:
            self._need(name)
        left_out: dict[str, Any] = dict.fromkeys(set(self.asked) - set(names))
        return replace(self, **left_out)

    def _need(self, name: str) -> None:
        if name not in self.asked:
            raise InputError(f"{name!r} is not demanded; demanded are {', '.join(self.asked)}")


def rational_of(zeros: Sequence[Any], poles: Sequence[Any], gain: float) -> Rational:
    """A rational function by lists of its zeros and poles."""
    return Rational(np.array(zeros, complex), np.array(poles, complex), gain)


def strictest(weights: Collection[DemandWeight]) -> list[DemandWeight]:
    """The weights without those that another one of the same shape includes."""
    found: dict[str, DemandWeight] = {}
    for one in weights:
        if one.shape not in found or one.size > found[one.shape].size:
            found[one.shape] = one
    return list(found.values())


def tracking(omega: float) -> Rational:
    """The weight (s / 2 + omega) / (s + omega / 1000) of S."""
    return rational_of([-PEAK_SENSITIVITY * omega], [-SLOW * omega], 1 / PEAK_SENSITIVITY)


def _recovery(nominal: Rational, omega: float) -> Rational:
    """The weight of S that bounds G S: stable and without zeros right of the axis, as every weight.

    Poles near the axis, as integrators, keep the distance of the pole of `tracking`.
    """
    own, least = tracking(omega), SLOW * omega
    poles, zeros = (_left(roots, least) for roots in (nominal.poles, nominal.zeros))
    outer = Rational(zeros, poles, abs(nominal.gain))
    gain = own.gain * outer.gain / float(np.abs(outer.response(np.array([omega]))[0]))
    return rational_of([*own.zeros, *zeros], [*own.poles, *poles], gain)


def _left(roots: np.ndarray, least: float) -> np.ndarray:
    """The roots mirrored to the left of the axis, at least so far from it."""
    return -np.maximum(np.abs(roots.real), least) + 1j * roots.imag


def _settling_bandwidth(time: float, damping: float) -> float:
    """Bandwidth [rad/s] with which a step settles within a time [s]."""
    return -math.log(SETTLED) / (min(2 * damping**2, 1.0) * time)


def _peak(damping: float) -> float:
    """Peak of T of two poles."""
    return 1.0 if damping >= NO_PEAK else 1 / (2 * damping * math.sqrt(1 - damping**2))


def _overshoot_of(peak: float) -> float:
    """Overshoot of two poles with a peak of T above 1."""
    # z^2 of 4 z^2 (1 - z^2) = 1 / peak^2, in a form without cancellation
    square = 0.5 / (peak**2 * (1 + math.sqrt(1 - peak**-2)))
    return math.exp(-math.pi * math.sqrt(square / (1 - square)))
