"""Repetitive control, which adds the error of one period ago to the present error.

    r(k) = Q (r + g e)(k - D),      the controller reads e + r            (the plug-in form)

The delay D and the phase lag of the low-pass filter Q together are one period at the period's own
frequency. Let S = 1 / (1 + L) be the sensitivity of the loop without repetitive control, and
T = 1 - S. Then the error is the disturbance times

    (1 - Q z^-D) / (1 - Q z^-D (1 - g T))  S,

which is nearly zero at the harmonics of the rotation within the passband of Q. By the small gain
theorem the loop is stable for every delay if S is stable and |Q (1 - g T)| < 1 at all frequencies.
(S. Hara, Y. Yamamoto, T. Omata, M. Nakano, IEEE Transactions on Automatic Control 33, 659-668,
1988.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.compiled import kernel
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.simulation.controllers import Controller, discrete_system


@dataclass(frozen=True)
class Repetitive:
    """Repetitive control of disturbances that repeat with the frequency `rotation_hz`.

    rotation_hz  frequency of the repetition [Hz], positive;
    dt    sampling period [s];
    corner_hz    corner frequency [Hz] of Q, a Butterworth filter of order 2;
    gain      g, above 0 and at most 1.

    Raises InputError for other values, and unless rotation < corner < half the sampling frequency.

    Examples
    --------
    >>> from workbench.simulation import Repetitive
    >>> repetitive = Repetitive(rotation_hz=10.0, dt=1e-3, corner_hz=200.0, gain=0.9)
    >>> repetitive.controller.outputs, round(repetitive.delay_samples, 3)
    (1, 98.873)
    """

    rotation_hz: float
    dt: float
    corner_hz: float
    gain: float = field(default=1.0, kw_only=True)

    def __post_init__(self) -> None:
        if not 0.0 < self.rotation_hz < math.inf:
            raise InputError(
                f"rotation frequency is {self.rotation_hz} Hz; repetitive control needs a "
                "positive, "
                "finite one"
            )
        if not (0.0 < self.dt < math.inf and 0.0 < self.gain <= 1.0):
            raise InputError(f"{self}: dt must be positive, and gain above 0 and at most 1")
        if not self.rotation_hz < self.corner_hz < 0.5 / self.dt:
            raise InputError(
                f"corner_hz is {self.corner_hz} Hz; it must lie between the rotation's "
                f"{self.rotation_hz} "
                f"Hz and half the sampling frequency, {0.5 / self.dt} Hz"
            )

    @cached_property
    def lowpass(self) -> StateSpace:
        """The filter Q in discrete time, by the bilinear transform."""
        import control

        omega = 2 * math.pi * self.corner_hz
        butterworth = control.tf([omega**2], [1.0, math.sqrt(2.0) * omega, omega**2])
        return discrete_system(butterworth, self.dt)

    @property
    def delay_samples(self) -> float:
        """The delay D [samples], in general not an integer.

        It is more than 1.5, because the phase lag of Q is less than 90 degrees.
        """
        turn = 2 * math.pi * self.rotation_hz * self.dt
        late = -float(np.angle(complex(self.lowpass(np.exp(1j * turn))))) / turn
        return 1.0 / (self.rotation_hz * self.dt) - late

    @property
    def controller(self) -> Controller:
        """Controller that reads e and gives r; its memory starts with zeros."""
        length = math.floor(self.delay_samples) + 2
        Q = self.lowpass
        matrices = (np.ravel(one) for one in (Q.A, Q.B, Q.C, Q.D))
        parameters = np.concatenate([[self.delay_samples, self.gain], *matrices])
        return Controller(_repeat, np.zeros(3 + length), parameters, dt=self.dt)

    def contraction(self, loop: StateSpace) -> StateSpace:
        """System Q (1 - g T) for a discrete loop transfer function L under negative feedback.

        Repetitive control is stable if its H-infinity norm is below 1. Raises InputError if the
        loop without repetitive control is not stable.
        """
        import control

        closed = control.feedback(loop, 1.0)
        radius = abs(closed.poles()).max(initial=0.0)
        if not radius < 1.0:
            raise InputError(f"the loop without repetitive control is unstable: |z| = {radius:.6g}")
        return control.ss(self.lowpass * (1.0 - self.gain * closed))


@kernel
def _repeat(state: RealArray, p: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of repetitive control; the state is the place in the memory, Q's states, the memory."""
    length = len(state) - 3
    place, whole = int(state[0]), int(p[0])
    rest = p[0] - whole
    # The memory holds r + g e at samples k - 1, k - 2, ..., before place. Interpolate at k - D.
    late = state[3 + (place - whole) % length]
    later = state[3 + (place - whole - 1) % length]
    past = (1.0 - rest) * late + rest * later
    x, y = state[1], state[2]
    told[0] = p[8] * x + p[9] * y + p[10] * past
    state[1] = p[2] * x + p[3] * y + p[6] * past
    state[2] = p[4] * x + p[5] * y + p[7] * past
    state[3 + place] = told[0] + p[1] * given[0]
    state[0] = (place + 1) % length
