"""How far the error can go while the carriage moves: certified for each drive.

The set: every motion of the carriage that is never faster than a speed v, whatever forces cause it.
In the linear loop the error is the convolution of the speed with an impulse response h, so its
supremum over the set is v |h|_1, and one history of the speed attains it.

The radial diodes read a sine of the error, so an error of at most E is read wrong by at most

    off(E) = E - p / (2 pi) sin(2 pi E / p),       p: track pitch,

which acts like noise of that size. By induction over the samples the error stays within E if

    v |h|_1 + the disc's error + |t|_1 off(E) <= E,

where t is the impulse response from such noise. Motions, discs and what is read wrong are taken to
be constant within a sample. Noise, rounding and the limit of the coil's voltage are left out, so
the lens must stay within its reach.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from workbench.simulation import discrete_system, sampled_model
from workbench.types import RealArray, StateSpace

from ...drive.photo_diodes import TRACK_PITCH
from ...drive.plants import ANTIALIASING, controller
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis, red_book
from ...laboratory.bench_setup import PERIOD, find_drive
from .carriage import carried_lens

SAMPLES = 4000
"""Length of the impulse responses; the slowest mode falls by a factor e in 6 ms or less."""
BISECTIONS = 50
EXCURSION = 1e-3
"""Distance [m] of the lens from its middle, against which the loop's gain at 0 Hz is finite."""


def read_wrong(error: float) -> float:
    """Largest amount [m] by which the radial diodes read an error of at most this [m] wrong."""
    turn = 2 * math.pi / TRACK_PITCH
    return error - math.sin(turn * error) / turn


@dataclass(frozen=True)
class MovedLoop:
    """The closed loop of one axis of a drive on a carriage that moves along this axis."""

    axis: Axis
    drive: str

    @cached_property
    def per_speed(self) -> RealArray:
        """Error [m] at the samples (SAMPLES,) after a sample at a speed of 1 m/s, without the rest
        that stays.
        """
        h = self._impulse(1)
        return h - h[-1]

    @cached_property
    def error_per_speed(self) -> float:
        """Largest error over the largest speed of the carriage [s], in the linear loop."""
        return float(abs(self.per_speed).sum() + self._tail(self.per_speed))

    @cached_property
    def reading_response(self) -> RealArray:
        """Error at the samples (SAMPLES,) after a sample at which it is read wrong by 1."""
        return self._impulse(2)

    @cached_property
    def per_reading(self) -> float:
        """Largest error over the largest amount by which the error is read wrong."""
        return float(abs(self.reading_response).sum() + self._tail(self.reading_response))

    @cached_property
    def rest(self) -> float:
        """Error [m] that stays with the lens EXCURSION from its middle."""
        return float(abs(self._impulse(1)[-1]) / PERIOD * EXCURSION)

    def disc_error(self, share: float, rotation: float) -> float:
        """Amplitude of the error [m] on a disc with this share of the Red Book's deviation, turning
        at `rotation` [Hz], in the linear loop.
        """
        z = np.exp(2j * np.pi * rotation * PERIOD)
        G = complex(self._open(z)[0, 0])
        K = complex(discrete_system(controller(self.axis), PERIOD)(z))
        return share * red_book(self.axis).deviation / abs(1.0 - K * G)

    def kept_speed(self, other: float = 0.0) -> float:
        """Largest speed [m/s] of the carriage with which the error surely stays acceptable.

        other: amplitude of other errors [m], such as the disc's.
        """
        return self._speed_within(ACCEPTABLE_ERROR[self.axis], other)

    def bound(self, speed: float, other: float = 0.0) -> float:
        """Certified bound [m] on the error with the carriage at up to a speed [m/s], up to the
        acceptable error; infinite beyond.
        """
        low, high = 0.0, ACCEPTABLE_ERROR[self.axis]
        if self._speed_within(high, other) < speed:
            return math.inf
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            enough = self._speed_within(middle, other) >= speed
            low, high = (low, middle) if enough else (middle, high)
        return high

    def worst_motion(self, speed: float) -> RealArray:
        """Speeds (SAMPLES,) of at most this size [m/s], after which the error is largest."""
        return speed * np.sign(self.per_speed[::-1])

    def worst_reading(self, size: float) -> RealArray:
        """Amounts (SAMPLES,) of at most this size [m] read wrong, after which the error is
        largest.
        """
        return size * np.sign(self.reading_response[::-1])

    def _speed_within(self, error: float, other: float) -> float:
        """Speed [m/s] of the carriage with which an acceptable error [m] is surely not passed."""
        wrong = self.per_reading * read_wrong(error) if self.axis == "radial" else 0.0
        return max(error - wrong - other - self.rest, 0.0) / self.error_per_speed

    @property
    def _open(self) -> StateSpace:
        return _opened(self)

    @cached_property
    def _closed(self) -> tuple[RealArray, RealArray, RealArray]:
        """Matrices of the closed loop from (u, carriage's speed, noise of the reading) to the
        error.
        """
        G, K = self._open, discrete_system(controller(self.axis), PERIOD)
        read, error = G.C[:1], -G.C[1:]
        a = np.block([[G.A + G.B[:, :1] @ K.D @ read, G.B[:, :1] @ K.C], [K.B @ read, K.A]])
        b = np.vstack([G.B, np.zeros((K.nstates, G.ninputs))])
        return a, b, np.hstack([error, np.zeros((1, K.nstates))])

    def _impulse(self, source: int) -> RealArray:
        """Error (SAMPLES,) after an impulse of an input of `_closed`."""
        a, b, c = self._closed
        state, found = b[:, source], np.zeros(SAMPLES)
        for k in range(SAMPLES):
            found[k] = c[0] @ state
            state = a @ state
        return found

    def _tail(self, response: RealArray) -> float:
        """Sum of what follows a response: its last tenth falls on as its slowest mode does."""
        poles = abs(np.linalg.eigvals(self._closed[0]))
        slowest = poles[poles < 1.0 - 1e-9].max()
        return float(abs(response[-SAMPLES // 10 :]).max() / (1.0 - slowest))


@cache
def moved_loop(axis: Axis, drive: str) -> MovedLoop:
    """The loop of an axis of a drive, whose responses are computed once."""
    return MovedLoop(axis, drive)


@cache
def _opened(loop: MovedLoop) -> StateSpace:
    """Sampled model from (u [V], carriage's speed [m/s], noise of the reading [m]) to f_en and
    lens [m].
    """
    import control

    lens, K_optn = carried_lens(loop.axis, loop.drive), find_drive(loop.axis, loop.drive).K_optn
    n = lens.nstates
    a, b = np.zeros((n + 1, n + 1)), np.zeros((n + 1, 3))
    a[:n, :n], b[:n, :2] = lens.A, lens.B
    a[n, :n], a[n, n] = -ANTIALIASING * K_optn * lens.C[0], -ANTIALIASING
    b[n, 2] = ANTIALIASING * K_optn
    c = np.zeros((2, n + 1))
    c[0, n], c[1, :n] = 1.0, lens.C[0]
    return sampled_model(control.ss(a, b, c, 0.0), PERIOD, delay_samples=1.0)
