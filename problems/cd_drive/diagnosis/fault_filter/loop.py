"""What a fault filter sits on: a drive's loop, the disc and its defects (figure 7.8).

    e = x_cd + f_sd - G (1 + W_c delta_c + W_r delta_r) K e,     u_f = F e,     K_f = F / K_optn

in metres, so that F S is what of a defect is estimated and what of the disc leaks into the
estimate. The anti-aliasing filter stands in the loop behind G; before F it is left out, and what is
estimated is the defect as that filter lets it through. Section, figure and equation numbers refer
to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import ComplexArray, RealArray
from workbench.diagnosis import Requirement
from workbench.heavy_types import StateSpace
from workbench.simulation import sampled
from workbench.systems.bilinear import to_continuous, to_sampled
from workbench.systems.connection import generalised_plant
from workbench.systems.generalised_plant import GeneralisedPlant, response
from workbench.systems.realisation import realisation
from workbench.uncertainty import UncertaintyModel

from ...drive.plants import ANTIALIASING
from ...drive.red_book import corners
from ...drive.tables import Axis, red_book
from ...laboratory.bench_setup import PERIOD

FAST = 1500.0
"""Frequency [Hz] from which on the relative error of the estimate counts."""
SLOW = 200.0
"""Up to which the disc's deviation leaks [Hz]."""
MOST = 2.0
"""Gain from a disc or a defect to the estimate that is allowed at any frequency."""
RATE = 2.0 / PERIOD
"""Of s = RATE (z - 1) / (z + 1)."""
SIDES = 24
"""Points on the boundary of a set of plants at each frequency."""


@dataclass(frozen=True, eq=False)
class FaultLoop:
    """A loop around all plants of a model; as a computer closes it where a delay is given.

    Parameters
    ----------
    model
        Of u [V] -> f_en [units], without the anti-aliasing filter.
    K
        f_en -> u, as the thesis has it: positive, closed with negative feedback.
    delay
        Turn-around [samples]: the plant is sampled behind a hold, K by the bilinear transform, and
        both brought back to continuous time by it, with the weights as they are. None: continuous.
    """

    axis: Axis
    model: UncertaintyModel
    K: StateSpace
    delay: float | None = None

    def warped(self, frequency: ArrayLike) -> RealArray:
        """Where this plant has its response at `frequency` [Hz]: omega [rad/s]."""
        omega = 2 * np.pi * np.asarray(frequency, float)
        return omega if self.delay is None else RATE * np.tan(omega / RATE)

    @cached_property
    def G(self) -> StateSpace:
        """Nominal plant, filter and delay included, u -> f_en."""
        import control

        filter_ = control.ss(-ANTIALIASING, ANTIALIASING, 1.0, 0.0)
        G = filter_ * self.model.systems()["G"]
        return G if self.delay is None else unsampled(sampled(G, PERIOD, self.delay))

    @cached_property
    def plant(self) -> GeneralisedPlant:
        """(perturbation; x_cd, f_sd) -> (perturbation; e) of the closed loop."""
        systems = self.model.systems()
        kinds = [kind for kind in ("r", "c") if f"W_{kind}" in systems]
        blocks = [(systems[f"W_{kind}"], "m", f"y_{kind}") for kind in kinds]
        perturbation = [
            (block, f"y_{kind}", f"u_{kind}")
            for kind, block in zip(kinds, self.model.structure, strict=True)
        ]
        return generalised_plant(
            [(self.G, "v", "x"), (self.K, "e", "m"), *blocks],
            {"v": " + ".join(["m", *(f"u_{kind}" for kind in kinds)]), "e": "x_cd + f_sd - x"},
            perturbation=perturbation,
            exogenous=["x_cd", "f_sd"],
            measurement="e",
        )

    def open_loop(self, omega: RealArray) -> ComplexArray:
        """L (F,) of the nominal loop."""
        parts = response(self.K, omega)[:, 0, 0], response(self.G, omega)[:, 0, 0]
        return parts[0] * parts[1]

    def differences(self, omega: RealArray, sides: int = SIDES) -> ComplexArray:
        """S_nominal / S (F, P) on the boundary of the set: 1 + T (W_c delta_c + W_r delta_r)."""
        L = self.open_loop(omega)
        T = L / (1 + L)
        circular, real = (part[:, None] for part in self._extents(omega, T))
        along = np.exp(1j * np.angle(real))
        cap = real + circular * along * np.exp(1j * np.pi * np.linspace(-0.5, 0.5, sides // 2))
        side = real * np.linspace(-1.0, 1.0, sides // 2)[1:-1] + 1j * circular * along
        return np.concatenate([1 + cap, 1 - cap, 1 + side, 1 - side], axis=1)

    def amplification(self, omega: RealArray) -> RealArray:
        """Largest |S / S_nominal| (F,) over the set; infinite where the loop may be unstable."""
        L = self.open_loop(omega)
        circular, real = self._extents(omega, L / (1 + L))
        along = np.clip(-real.real / np.maximum(np.abs(real) ** 2, np.finfo(float).tiny), -1, 1)
        distance = np.abs(1 + along * real) - circular
        with np.errstate(divide="ignore"):
            return np.where(distance > 0, 1 / np.maximum(distance, 0.0), np.inf)

    def _extents(self, omega: RealArray, T: ComplexArray) -> tuple[RealArray, ComplexArray]:
        """Radius and end of the stadiums of T (W_c delta_c + W_r delta_r)."""
        real = np.zeros(len(omega), complex)
        if self.model.W_r is not None:
            real = self.model.W_r.response(omega) * T
        return np.abs(self.model.W_c.response(omega) * T), real

    def requirements(self, error: float, leakage: float) -> list[Requirement]:
        """Relative error above FAST, leakage [m] of the disc below SLOW, gain anywhere."""
        fast, slow = (float(self.warped(frequency)) for frequency in (FAST, SLOW))
        return [
            Requirement("error", "f_sd", 1.0, error, (fast, np.inf)),
            Requirement("leakage", "x_cd", disc_weight(self.axis), leakage, (0.0, slow)),
            Requirement("gain", "x_cd", 1.0, MOST),
        ]


def disc_weight(axis: Axis) -> StateSpace:
    """A weight with at least the Red Book's envelope [m] below its last corner.

    Exact where that is flat and where the acceleration limits it, up to 15 % more at the corner.
    """
    import control

    omega = 2 * np.pi * corners(axis)[0]
    size = red_book(axis).deviation
    return control.ss(control.tf([size * omega**2], [1.0, omega, omega**2]))


def unsampled(system: StateSpace) -> StateSpace:
    """A sampled system in continuous time, s = RATE (z - 1) / (z + 1)."""
    A, B, C, D = to_continuous((system.A, system.B, system.C, system.D))
    return realisation((RATE * A, RATE * B, C, D), 0.0)


def resampled(system: StateSpace) -> StateSpace:
    """The sampled system that `unsampled` makes this one of."""
    A, B, C, D = to_sampled((system.A / RATE, system.B / RATE, system.C, system.D))
    return realisation((A, B, C, D), PERIOD)
