"""Periodic disturbances of a rotation, modelled by oscillators that follow its frequency.

    p, q at the next sample = p cos(h w T) - q sin(h w T),  p sin(h w T) + q cos(h w T)

is an internal model of the disturbance at harmonic h of a rotation w [rad/s], sampled every T [s].
An observer corrects (p, q) by its prediction error. If w is wrong, the corrections turn the vector
(p, q) on average by the angle that is missing in each sample, the true w T less the assumed one.
They are therefore the phase detector of a phase-locked loop whose integrator is w.
"""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass

import numpy as np
from scipy.linalg import block_diag

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.input_checks import is_real, need_numbers


@dataclass(frozen=True)
class Rotation:
    """A frequency of rotation and the harmonics of it that disturb the plant.

    frequency_hz  of the rotation [Hz];
    adaptation  rate of the frequency loop [1/s]; 0: the frequency stays;
    range_hz    lowest and highest frequency that may be followed [Hz]; None: half of
                `frequency_hz` and twice that;
    floor       amplitude of the first harmonic below which adaptation fades, because a small
                oscillation tells little of its frequency; in the unit of the disturbance.

    With an observer whose first oscillator settles at the rate a [1/s], frequency and phase errors
    obey e'' + a e' + a g e = 0 with g = adaptation, on average and while both are small. This is
    stable for every g and has no overshoot for g up to a/4; it then settles about as exp(-g t). The
    frequency settles on the true one; a constant offset or another frequency in the record moves it
    for a while only.

    Raises InputError for a frequency, harmonics, range, rate or floor that is not possible.

    Examples
    --------
    >>> from workbench.diagnosis import Rotation
    >>> rotation = Rotation(frequency_hz=10.0, harmonics=(1, 2))
    >>> rotation.limits_hz, rotation.oscillators(1e-3).shape
    ((10.0, 10.0), (4, 4))
    """

    frequency_hz: float
    _: KW_ONLY
    harmonics: tuple[int, ...] = (1,)
    adaptation: float = 0.0
    range_hz: tuple[float, float] | None = None
    floor: float = 0.0

    def __post_init__(self) -> None:
        need_numbers(frequency_hz=self.frequency_hz, adaptation=self.adaptation, floor=self.floor)
        if not (math.isfinite(self.frequency_hz) and self.frequency_hz > 0.0):
            raise InputError(
                f"rotation frequency is {self.frequency_hz} Hz; it must be positive and finite"
            )
        h = self.harmonics
        whole = isinstance(h, tuple | list) and all(is_real(one) and one % 1 == 0 for one in h)
        if not whole or not h or min(h) < 1 or len(set(h)) < len(h):
            raise InputError(f"harmonics are {h}; they must be different integers of 1 or more")
        if self.range_hz is not None:
            pair = isinstance(self.range_hz, tuple | list) and len(self.range_hz) == 2
            if not (pair and all(map(is_real, self.range_hz))):
                raise InputError(
                    f"range of the rotation is {self.range_hz!r}; give two numbers [Hz]"
                )
        low, high = self.limits_hz
        if not 0.0 < low <= self.frequency_hz <= high < math.inf:
            raise InputError(
                f"range of the rotation is {low} to {high} Hz; it must be positive and contain "
                f"{self.frequency_hz} Hz"
            )
        if not (0.0 <= self.adaptation < math.inf and 0.0 <= self.floor < math.inf):
            raise InputError(
                f"adaptation is {self.adaptation} 1/s and floor {self.floor}; neither may be "
                "negative or infinite"
            )
        if self.adaptation > 0.0 and h[0] != 1:
            raise InputError(
                f"harmonics are {h}; adaptation follows the first harmonic: put 1 in front"
            )

    @property
    def limits_hz(self) -> tuple[float, float]:
        """The lowest and the highest frequency [Hz] that may be followed."""
        if self.adaptation == 0.0:
            return self.frequency_hz, self.frequency_hz
        return self.range_hz or (self.frequency_hz / 2, 2 * self.frequency_hz)

    def oscillators(self, dt: float) -> RealArray:
        """The transition matrix (2 h, 2 h) of the oscillators over a sample of `dt` [s].

        Raises InputError if a harmonic reaches half the sampling frequency.
        """
        _need_sampling_time(dt)
        highest = max(self.harmonics) * self.limits_hz[1]
        if not highest < 0.5 / dt:
            raise InputError(
                f"harmonic {max(self.harmonics)} of up to {self.limits_hz[1]} Hz is {highest} "
                "Hz; it "
                f"must stay below half the sampling frequency, {0.5 / dt} Hz"
            )
        angles = [2 * np.pi * h * self.frequency_hz * dt for h in self.harmonics]
        blocks = [[[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]] for a in angles]
        transition: RealArray = block_diag(*blocks)
        return transition

    def poles(self, dt: float, decay: float) -> ComplexArray:
        """Discrete poles (2 h,) for an observer of the oscillators that settles at `decay` 1/s."""
        _need_sampling_time(dt)
        need_numbers(decay=decay)
        if not (math.isfinite(decay) and decay > 0.0):
            raise InputError(f"decay of the oscillators is {decay} 1/s; it must be positive")
        s = [-decay + 2j * np.pi * h * self.frequency_hz for h in self.harmonics]
        upper = np.exp(np.array(s) * dt)
        return np.concatenate([upper, upper.conj()])


def _need_sampling_time(dt: float) -> None:
    need_numbers(dt=dt)
    if not 0.0 < dt < math.inf:
        raise InputError(f"dt is {dt} s; it must be positive and finite")
