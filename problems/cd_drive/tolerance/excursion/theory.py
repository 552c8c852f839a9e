"""Distance between lens and disc while a defect blinds the loop, in closed form (eq. 8.1).

The disc deviates by A sin(w t), and the controller's input is zero for dt. There are three
theories, each closer to the loop than the one before: a lens that stops, a lens that keeps its
speed and the coil's voltage, and a lens that the controller still drives from its own states.
Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag, expm

from workbench.types import ComplexArray, RealArray, StateSpace

from ...drive.actuator import specific_model
from ...drive.plants import ANTIALIASING, controller
from ...drive.tables import Axis
from ...laboratory.bench_setup import coil_gain, find_drive

WORST = (9.0, 1.9e-3)
"""Rotation [Hz] and duration [s] with which eq. 8.1 gives the worst case of the thesis, 53.7 um."""


def standing(
    amplitude: ArrayLike, rotation: float, duration: ArrayLike, middle: ArrayLike
) -> RealArray:
    """Error [m] after `duration` [s] of a lens that stops; all arguments broadcast.

        A (sin(m + w dt / 2) - sin(m - w dt / 2)) = 2 A sin(w dt / 2) cos(m),

    where m, ``middle`` [rad], is the disc's angle in the middle of the defect. Equation 8.1, whose
    angle counts from the defect's start, is the same for a defect that starts at a zero crossing;
    the worst defect is symmetric about a zero crossing, cos(m) = 1.
    """
    half = np.pi * rotation * np.asarray(duration, float)
    return np.asarray(2.0 * np.asarray(amplitude) * np.sin(half) * np.cos(middle), float)


@dataclass(frozen=True)
class BlindLens:
    """A drive's lens that follows a steady wobble until its loop becomes blind.

    amplitude [m] and rotation [Hz]: of the wobble. driven: whether the controller continues with an
    error of 0 (figure 8.2); otherwise the loop followed the disc exactly, and the coil keeps its
    voltage.
    """

    axis: Axis
    drive: str
    amplitude: float
    rotation: float
    driven: bool

    @property
    def omega(self) -> float:
        return 2 * np.pi * self.rotation

    @cached_property
    def free(self) -> RealArray:
        """Matrix F of x' = F x; x has the states of the lens and of the source of its voltage."""
        lens, source, feed = self._parts
        matrix = block_diag(lens.A, source)
        matrix[: lens.nstates, lens.nstates :] = lens.B @ feed
        return np.asarray(matrix, float)

    @cached_property
    def steady(self) -> ComplexArray:
        """Phasor of these states for a disc motion amplitude exp(j w t)."""
        import control

        lens, _, feed = self._parts
        s = 1j * self.omega
        there = np.linalg.solve(s * np.eye(lens.nstates) - lens.A, lens.B)[:, 0]
        follows = lens.C[0] @ there
        if not self.driven:  # one state: the voltage itself
            volts = self.amplitude / follows
            return np.append(there * volts, volts)
        K = control.ss(controller(self.axis))
        seen = find_drive(self.axis, self.drive).K_optn / (1.0 + s / ANTIALIASING)
        inner = np.linalg.solve(s * np.eye(K.nstates) - K.A, K.B)[:, 0]
        gain = feed[0] @ inner  # K has no feedthrough
        error = self.amplitude / (1.0 + seen * gain * follows)
        return np.concatenate([there * gain * seen * error, inner * seen * error])

    def error(self, duration: float, middle: ArrayLike) -> RealArray:
        """Errors x_cd - x [m] (N,) at the end of a defect whose middle is at angles [rad] (N,)."""
        middles = np.atleast_1d(np.asarray(middle, float))
        start = middles - self.omega * duration / 2
        # x_cd = A sin(angle) is the imaginary part of the phasor rotated by the angle.
        states = np.imag(self.steady * np.exp(1j * start)[:, None])
        n = self._parts[0].nstates
        ended = states @ expm(self.free * duration).T
        lens: RealArray = ended[:, :n] @ self._parts[0].C[0]
        return self.amplitude * np.sin(middles + self.omega * duration / 2) - lens

    @cached_property
    def _parts(self) -> tuple[StateSpace, RealArray, RealArray]:
        """Lens [coil V -> m], matrix of the voltage source, and its output matrix to the
        coil [V].
        """
        import control

        drive = find_drive(self.axis, self.drive)
        lens = specific_model(drive).state_space()
        if not self.driven:
            return lens, np.zeros((1, 1)), np.ones((1, 1))
        K = control.ss(controller(self.axis))
        return lens, K.A, coil_gain(drive) * K.C
