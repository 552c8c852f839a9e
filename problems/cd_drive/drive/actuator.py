"""The actuator of a CD drive: a voice coil that moves masses on springs and dampers (chapter 3).

Both models of the thesis are assembled from their element equations; nothing is expanded by hand.
With displacements x, coil current i and applied voltage u,

    M x'' + C x' + K x = g Bl i        masses, dampers, springs   (eq. 3.4, 3.7, 3.12-3.13)
    L i' + R i + Bl g'x' = u           coil with back-EMF         (eq. 3.1-3.2)

where g selects the first mass, which carries the coil and the lens. Equation numbers refer to E.
Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import InputError
from workbench.types import ComplexArray, RealArray, StateSpace

from .tables import ActuatorParameters, Drive

SERIES_RESISTANCE = 1.25
"""r [ohm]: resistor in series with the coil that measures its current (section 3.6.2)."""


@dataclass(frozen=True)
class Actuator:
    """Matrices of the element equations; the leading axes `...` of all fields hold a batch of
    drives.

    M, C, K: masses [kg], dampers [N s/m], springs [N/m], each (..., n, n).
    Bl [N/A], R [ohm] (the whole circuit), L [H]: (...). L = 0 leaves the inductance out.
    """

    M: RealArray
    C: RealArray
    K: RealArray
    Bl: RealArray
    R: RealArray
    L: RealArray

    def response(self, frequency: ArrayLike) -> ComplexArray:
        """Lens displacement per applied voltage x/u [m/V] at `frequency` [Hz] (F,): (..., F).

        Solves (s^2 M + s C + K) x = g Bl i for the whole batch at once. Raises InputError if the
        frequencies are not a 1-D array of positive finite numbers.
        """
        s = 2j * np.pi * checked_frequency(frequency)
        bl, impedance = self.Bl[..., None], self.R[..., None] + s * self.L[..., None]
        s = s[:, None, None]
        dynamic = s**2 * self.M[..., None, :, :] + s * self.C[..., None, :, :]
        dynamic = dynamic + self.K[..., None, :, :]
        dynamic[..., 0, 0] += s[:, 0, 0] * bl**2 / impedance
        force = np.zeros((*dynamic.shape[:-1], 1), complex)
        force[..., 0, 0] = bl / impedance
        return np.linalg.solve(dynamic, force)[..., 0, 0]

    def state_space(self) -> StateSpace:
        """The model u [V] -> x [m] of one drive; states x, x' and, with an inductance, i."""
        import control  # slow to load, and not needed for the frequency responses above

        a, b = self._state_matrices()
        c = np.zeros((1, len(a)))
        c[0, 0] = 1.0
        return control.ss(a, b, c, 0.0, inputs="u", outputs="x")

    def poles(self) -> ComplexArray:
        """Poles of one drive [rad/s], sorted by magnitude."""
        poles = np.linalg.eigvals(self._state_matrices()[0]).astype(complex)
        return poles[np.argsort(abs(poles))]

    def zeros(self) -> ComplexArray:
        """Zeros of u -> x of one drive [rad/s]: the poles of what still moves when the lens is
        held.
        """
        held = _first_order(*(matrix[1:, 1:] for matrix in (self.M, self.C, self.K)))
        zeros = np.linalg.eigvals(held).astype(complex)
        return zeros[np.argsort(abs(zeros))]

    def _state_matrices(self) -> tuple[RealArray, RealArray]:
        if self.M.ndim != 2:
            raise InputError(f"a batch of {self.M.shape[:-2]} drives; take one drive at a time")
        n = len(self.M)
        acceleration = np.linalg.solve(self.M, np.eye(n)[:, :1]) * self.Bl
        if self.L == 0.0:
            damping = self.C.copy()
            damping[0, 0] += self.Bl**2 / self.R
            b = np.vstack([np.zeros((n, 1)), acceleration / self.R])
            return _first_order(self.M, damping, self.K), b
        a = np.zeros((2 * n + 1, 2 * n + 1))
        a[:-1, :-1] = _first_order(self.M, self.C, self.K)
        a[n:-1, -1:] = acceleration
        a[-1, n] = -self.Bl / self.L
        a[-1, -1] = -self.R / self.L
        b = np.zeros((2 * n + 1, 1))
        b[-1, 0] = 1.0 / self.L
        return a, b


def specific_model(
    parameters: ActuatorParameters, series_resistance: float = SERIES_RESISTANCE
) -> Actuator:
    """The fourth-order model: two masses, no inductance (eq. 3.12-3.14, Table 3.2).

    The lens side m1 hangs by k2, b2 on the arm m2, which hangs by k1, b1 on the frame.
    `series_resistance` [ohm] is added to the coil's.
    """
    p = parameters
    lens, arm = np.eye(2)
    return Actuator(
        M=_element(p.m1, lens) + _element(p.m2, arm),
        C=_element(p.b1, arm) + _element(p.b2, lens - arm),
        K=_element(p.k1, arm) + _element(p.k2, lens - arm),
        Bl=np.array(p.Bl),
        R=np.array(p.R + series_resistance),
        L=np.array(0.0),
    )


def general_model(drive: Drive, series_resistance: float = SERIES_RESISTANCE) -> Actuator:
    """The third-order model: one mass m1 + m2 on k and b, with inductance (eq. 3.10).

    The power driver's gain K_pd of eq. 3.10 is left to the loop. `series_resistance` [ohm] is added
    to the coil's; eq. 3.10 itself has none.
    """
    return Actuator(
        M=np.array([[drive.m1 + drive.m2]]),
        C=np.array([[drive.b]]),
        K=np.array([[drive.k]]),
        Bl=np.array(drive.Bl),
        R=np.array(drive.R + series_resistance),
        L=np.array(drive.L),
    )


def stack(actuators: Sequence[Actuator]) -> Actuator:
    """A batch of N models of the same kind; its fields have N as their leading axis."""
    if not actuators:
        raise InputError("no actuators to stack; give at least one")
    return Actuator(
        *(np.stack([getattr(a, field.name) for a in actuators]) for field in fields(Actuator))
    )


def transfer_coefficients(
    parameters: ActuatorParameters, series_resistance: float = SERIES_RESISTANCE
) -> tuple[RealArray, RealArray]:
    """Numerator (3,) and denominator (5,) of the specific model, as printed in Table 3.2."""
    p, r = parameters, parameters.R + series_resistance
    num = p.Bl * np.array([p.m2, p.b1 + p.b2, p.k1 + p.k2])
    den = r * np.array(
        [
            p.m1 * p.m2,
            p.m1 * (p.b1 + p.b2) + p.m2 * p.b2,
            p.m1 * (p.k1 + p.k2) + p.m2 * p.k2 + p.b1 * p.b2,
            p.k1 * p.b2 + p.k2 * p.b1,
            p.k1 * p.k2,
        ]
    )
    den[1:4] += p.Bl * num  # back-EMF: the force is Bl i, and the induced voltage Bl x'
    return num, den


@dataclass(frozen=True)
class Resonances:
    """Natural frequencies |s| / 2 pi [Hz] of the specific model's pairs of poles and zeros."""

    first: float
    parasitic_zero: float
    parasitic_pole: float


def resonances(
    parameters: ActuatorParameters, series_resistance: float = SERIES_RESISTANCE
) -> Resonances:
    """The suspension's resonance, and the parasitic pair of zeros and poles, with the back-EMF."""
    actuator = specific_model(parameters, series_resistance)
    poles, zeros = (abs(s) / (2 * np.pi) for s in (actuator.poles(), actuator.zeros()))
    return Resonances(float(poles[0]), float(zeros[0]), float(poles[2]))


def checked_frequency(frequency: ArrayLike) -> RealArray:
    """Frequencies as floats (F,). Raises InputError if they are not a non-empty 1-D array of
    positive finite numbers.
    """
    array = np.asarray(frequency, dtype=float)
    if array.ndim != 1 or array.size == 0:
        raise InputError(f"frequency has shape {array.shape}; it must be a 1-D array, not empty")
    if not (np.isfinite(array) & (array > 0.0)).all():
        bad = array[~(np.isfinite(array) & (array > 0.0))][0]
        raise InputError(f"frequency contains {bad}; every frequency [Hz] must be positive, finite")
    return array


def _element(value: float, ends: RealArray) -> RealArray:
    """Contribution of an element to M, C or K; `ends` maps displacements to its elongation."""
    return value * np.outer(ends, ends)


def _first_order(mass: RealArray, damping: RealArray, stiffness: RealArray) -> RealArray:
    """State matrix of mass x'' + damping x' + stiffness x = 0 for the states x, x'."""
    n = len(mass)
    lower = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    return np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), lower])
