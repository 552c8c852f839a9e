"""Both axes of a drive as one system, with the couplings that section 3.5 lists.

The lens body and the arm move along both axes and roll about the track's direction,

    q = (x, y, roll, x', y', roll'),        M q'' + C q' + K q = T Bl i,

where x is the focus direction, y the radial one, and primes belong to the arm. Without coupling
each axis is the specific model of chapter 3, and nothing rolls. The currents obey
(R + r) i = v - Bl T' q', so the coils' fields act on both axes and back alike. Section and figure
numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Self

import numpy as np

from workbench.errors import InputError
from workbench.types import ComplexArray, RealArray, StateSpace

from ..drive.actuator import SERIES_RESISTANCE
from ..drive.tables import AXES, Drive
from ..laboratory.bench_setup import coil_gain, find_drive

HALF_WIDTH, HALF_HEIGHT = 4e-3, 2e-3
"""Distances [m] of the four arms from the middle, across the tracks and along the light (figure
3.2); a guess from pickups of this kind.
"""
GYRATION = 3.5e-3
"""Radius of gyration [m] of the lens body about the track's direction; a guess for its size."""
LENS_HEIGHT = 2e-3
"""Height [m] of the lens above the axis about which the body rolls; a guess."""
CORNERS = np.array([(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)])
"""Places of the arms, in half widths and half heights."""
ODD_ARM = np.array([1.0, -1 / 3, -1 / 3, -1 / 3])
"""Deviation of the arms' springs from their mean if the first one differs by 1; the mean stays."""


@dataclass(frozen=True)
class Coupling:
    """Sizes of the couplings between the two loops; 0 leaves one out.

    Parameters
    ----------
    electrical
        Share of each control voltage that reaches the other coil.
    magnetic
        Share of each coil's force that acts along the other axis.
    springs
        Excess of one arm's spring and damper over the mean of the four.
    tilt
        Angle between the focus direction and the disc's normal [rad].
    optical
        Share of each error that the diodes of the other axis see.

    Raises InputError for a size that is not finite, and for springs outside -1 to 3, where a spring
    would be negative.
    """

    electrical: float = 0.0
    magnetic: float = 0.0
    springs: float = 0.0
    tilt: float = 0.0
    optical: float = 0.0

    def __post_init__(self) -> None:
        for name, size in asdict(self).items():
            if not math.isfinite(size):
                raise InputError(f"{name} is {size}; it must be finite")
        if not -1.0 < self.springs < 3.0:
            raise InputError(f"springs is {self.springs}; it must lie between -1 and 3")

    @classmethod
    def alone(cls, path: str, size: float) -> Self:
        """One path with this size. Raises InputError for an unknown path."""
        if path not in (known := cls.__dataclass_fields__):
            raise InputError(f"path is {path!r}; known: {', '.join(known)}")
        return cls(**{path: size})


UNCOUPLED = Coupling()
"""Two axes that know nothing of each other."""


@dataclass(frozen=True)
class TwoAxes:
    """Both axes of one drive, "CD1" ... "CD12" or "nominal", with their coupling."""

    drive: str
    coupling: Coupling = UNCOUPLED

    @property
    def axes(self) -> tuple[Drive, Drive]:
        """Entries of Tables A.1 to A.3 of the focus and of the radial axis."""
        focus, radial = (find_drive(axis, self.drive) for axis in AXES)
        return focus, radial

    @property
    def matrices(self) -> tuple[RealArray, RealArray, RealArray]:
        """Masses M, dampers C and springs K, each (6, 6)."""
        focus, radial = self.axes
        body = np.diag([focus.m1, radial.m1, focus.m1 * GYRATION**2])
        at_corners = HALF_WIDTH**2 + HALF_HEIGHT**2
        arm = np.diag([focus.m2, radial.m2, focus.m2 * at_corners])
        nothing = np.zeros((3, 3))
        arms = 1.0 + self.coupling.springs * ODD_ARM
        found = [np.block([[body, nothing], [nothing, arm]])]
        for frame, link in (("b1", "b2"), ("k1", "k2")):
            held = _of_arms(getattr(focus, frame), getattr(radial, frame), arms)
            linked = _of_arms(getattr(focus, link), getattr(radial, link), np.ones(4))
            found.append(np.block([[linked, -linked], [-linked, held + linked]]))
        mass, damper, spring = found
        return mass, damper, spring

    @property
    def electromechanics(self) -> tuple[RealArray, RealArray]:
        """Force per control voltage (6, 2) [N/V], and the damping (6, 6) by the back-EMF."""
        drives, size = self.axes, self.coupling
        Bl = np.array([one.Bl for one in drives])
        along = np.zeros((6, 2))
        along[:2] = _crossed(size.magnetic)
        push = along * (Bl / [one.R + SERIES_RESISTANCE for one in drives])
        volts = np.diag([coil_gain(one) for one in drives]) @ _crossed(size.electrical)
        return push @ volts, push * Bl @ along.T

    @property
    def focus_point(self) -> RealArray:
        """Matrix (2, 6) from q to the focus point (x, y)."""
        lens = np.zeros((2, 6))
        lens[0, 0] = lens[1, 1] = 1.0
        lens[1, 2] = LENS_HEIGHT
        tilt = self.coupling.tilt
        return np.array([[1.0, -tilt], [tilt, 1.0]]) @ lens

    @property
    def actuator(self) -> StateSpace:
        """Control voltages (u_F, u_R) [V] -> focus point (x, y) [m]."""
        import control

        M, C, K = self.matrices
        force, damping = self.electromechanics
        a = np.zeros((12, 12))
        a[:6, 6:] = np.eye(6)
        a[6:] = -np.linalg.solve(M, np.hstack([K, C + damping]))
        b = np.vstack([np.zeros((6, 2)), np.linalg.solve(M, force)])
        c = np.hstack([self.focus_point, np.zeros((2, 6))])
        return control.ss(a, b, c, 0.0, inputs=["u_F", "u_R"], outputs=["x", "y"])

    def response(self, omega: RealArray) -> ComplexArray:
        """Response (F, 2, 2) of the actuator [m/V] at frequencies [rad/s] (F,)."""
        M, C, K = self.matrices
        force, damping = self.electromechanics
        s = 1j * omega[:, None, None]
        found: ComplexArray = self.focus_point @ np.linalg.solve(
            s**2 * M + s * (C + damping) + K, np.broadcast_to(force + 0j, (len(omega), 6, 2))
        )
        return found

    @property
    def optics(self) -> RealArray:
        """Matrix (2, 2) from the errors to those that the diodes see."""
        return _crossed(self.coupling.optical)


def _crossed(share: float) -> RealArray:
    """Matrix (2, 2) that passes each signal on, and a share of it to the other axis."""
    return np.array([[1.0, share], [share, 1.0]])


def _of_arms(focus: float, radial: float, arms: RealArray) -> RealArray:
    """Spring or damper matrix (3, 3) of (x, y, roll) by four arms that share both values.

    arms (4,): each arm's value over the mean.
    """
    found = np.zeros((3, 3))
    for (across, along), share in zip(CORNERS, arms / 4, strict=True):
        vertical = np.array([1.0, 0.0, across * HALF_WIDTH])
        horizontal = np.array([0.0, 1.0, -along * HALF_HEIGHT])
        found += share * focus * np.outer(vertical, vertical)
        found += share * radial * np.outer(horizontal, horizontal)
    return found
