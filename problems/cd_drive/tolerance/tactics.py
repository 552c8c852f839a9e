"""Strategies: input and action of the controller while a surface defect passes (chapter 8).

Every strategy is a cascade of parts behind the same detector, which gives w_Q. Equation, figure and
section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from workbench.diagnosis import Rotation
from workbench.errors import InputError, UnknownNameError
from workbench.simulation import (
    Cascade,
    Controller,
    Part,
    Repetitive,
    adder,
    blender,
    discrete_system,
    fault_subtractor,
    interval_gate,
    linear_controller,
    tracking_controller,
    zero_controller,
)
from workbench.types import StateSpace

from ..diagnosis.position_estimator.model import kalman
from ..diagnosis.position_estimator.trials import DIST_MAX, DIST_MIN
from ..diagnosis.quality import (
    Quality,
    dimming_detector,
    diode_quality,
    no_alarm,
)
from ..diagnosis.stand_in import low_pass
from ..drive.plants import controller
from ..drive.tables import Axis
from ..laboratory.bench_setup import PERIOD, find_drive
from ..laboratory.experiment import MEASUREMENTS, Laboratory

if TYPE_CHECKING:
    from control.lti import LTI

FOLLOWING = 500.0
"""Rate [1/s] at which the controller that is not in charge follows the command."""
CORNER = 200.0
"""Corner [Hz] of the repetitive control's low-pass: 36 harmonics of the rotation."""


def stand_in_filter() -> StateSpace:
    """Discrete stand-in F for the fault filter: it returns the part of a signal that the low-pass
    removes.
    """
    return discrete_system(1 - low_pass(), PERIOD)


@dataclass(frozen=True, eq=False)
class Strategies:
    """The strategies of one axis by name.

    Parameters
    ----------
    axis
        Focus or radial.
    level
        Level of the diodes' sum on a clean disc [V].
    rotation
        Rotation frequency of the disc [Hz], which A and B have to know.
    F
        Discrete fault filter of C: e = f_en / K_optn [m] -> estimated fault u_f [m]. Default: a
        stand-in.
    replacement
        Discrete or continuous controller K' of the strategy that switches to it, such as that of
        `cd/<axis>/lower-bandwidth`.
    bumpless
        Whether K and K' follow each other while they are not in charge. Otherwise their integrals
        drift apart, and radially the track is lost (see the tests).
    false
        Start and end [s] of detections where there is no defect.
    K
        Controller. Default: the axis' reference controller.
    corner
        Corner of the repetitive control's low-pass [Hz].
    quality
        Signal that is w_Q: graded (eq. 7.13), binary, or prompt.
    dimmed
        Start and end [s] of what dims the light, which only a prompt quality knows.
    """

    axis: Axis
    level: float
    rotation: float
    F: StateSpace | None = None
    replacement: StateSpace | None = None
    bumpless: bool = True
    false: Sequence[tuple[float, float]] = ()
    K: StateSpace | None = None
    corner: float = CORNER
    quality: Quality = "graded"
    dimmed: Sequence[tuple[float, float]] = ()

    def named(self, name: str) -> Cascade:
        """Return a strategy by its name in STRATEGIES. Raises UnknownNameError for another name."""
        if name not in STRATEGIES:
            raise UnknownNameError("strategy", name, STRATEGIES)
        return Cascade(MEASUREMENTS, [*self.detector, *STRATEGIES[name](self)])

    @property
    def controller(self) -> LTI:
        """K, or the axis' reference controller."""
        return controller(self.axis) if self.K is None else self.K

    @property
    def repetitive(self) -> Repetitive:
        """Repetitive filter of strategy A. Raises InputError for a rotation frequency of 0."""
        return Repetitive(self.rotation, PERIOD, self.corner)

    @property
    def detector(self) -> list[Part]:
        """Parts that compute the quality w_Q, which is 0 in false detections."""
        return [*self._quality, Part("w_Q", interval_gate(self.false, PERIOD), ["quality"])]

    @property
    def _quality(self) -> list[Part]:
        """Parts that compute the quality."""
        if self.quality == "prompt":
            return [
                Part("alarm", zero_controller(), []),
                Part("lit", no_alarm(), ["alarm"]),
                Part("quality", interval_gate(self.dimmed, PERIOD), ["lit"]),
            ]
        if self.quality == "binary":
            return [
                Part("alarm", dimming_detector(self.level), MEASUREMENTS),
                Part("quality", no_alarm(), ["alarm"]),
            ]
        seen = diode_quality(self.level, DIST_MIN, DIST_MAX)
        return [Part("detector", seen, MEASUREMENTS, outputs=("quality", "dist", "error_read"))]

    @property
    def _law(self) -> Controller:
        return linear_controller(self.controller, PERIOD)

    def _reference(self) -> list[Part]:
        """Figure 8.2: the loop is opened, and the controller continues with an error of 0."""
        return [
            Part("seen", blender(), ["w_Q", "f_en"]),
            Part("K", self._law, ["seen"], outputs=["u"]),
        ]

    def _repetitive(self) -> list[Part]:
        """Strategy A, figure 8.3: the repetitive filter continues with the periodic command it has
        learnt.
        """
        return [
            Part("trusted", blender(), ["w_Q", "f_en"]),
            Part("REP", self.repetitive.controller, ["trusted"]),
            Part("seen", adder(), ["trusted", "REP"]),
            Part("K", self._law, ["seen"], outputs=["u"]),
        ]

    def _estimated(self) -> list[Part]:
        """Strategy B, figure 8.4: the estimated error takes over; u_p is added at all times."""
        estimator = kalman(self.axis, Rotation(self.rotation)).controller
        told = ("f_en_hat", "e_hat", "x_hat", "u_p", "rotation")
        return [
            Part("estimator", estimator, ["f_en", "u_last", "w_Q"], outputs=told),
            Part("seen", blender(), ["w_Q", "f_en", "f_en_hat"]),
            Part("K", self._law, ["seen"], outputs=["u_k"]),
            Part("u", adder(), ["u_k", "u_p"]),
        ]

    def _removed(self) -> list[Part]:
        """Strategy C, figure 8.5: f_en - (1 - w_Q) K_optn u_f, u_f = F e, e = f_en / K_optn."""
        K_optn = find_drive(self.axis, "nominal").K_optn
        F = stand_in_filter() if self.F is None else self.F
        return [
            Part("u_f", linear_controller(F / K_optn, PERIOD), ["f_en"]),
            Part("seen", fault_subtractor(gain=K_optn), ["w_Q", "f_en", "u_f"]),
            Part("K", self._law, ["seen"], outputs=["u"]),
        ]

    def _replaced(self) -> list[Part]:
        """Figure 8.6 as one controller: K' gives the command while w_Q is 0."""
        other = self.replacement
        if other is None:
            raise InputError(
                "the strategy K_prime needs a controller K', and no replacement is given; "
                f"cd/{self.axis}/lower-bandwidth designs one"
            )
        if not self.bumpless:
            return [
                Part("K", linear_controller(self.controller, PERIOD), ["f_en"], outputs=["u_k"]),
                Part("K'", linear_controller(other, PERIOD), ["f_en"], outputs=["u_k'"]),
                Part("u", blender(), ["w_Q", "u_k", "u_k'"]),
            ]
        follower = tracking_controller(self.controller, PERIOD, FOLLOWING)
        substitute = tracking_controller(other, PERIOD, FOLLOWING, substitute=True)
        return [
            Part("K", follower, ["f_en", "w_Q", "u_last"], outputs=["u_k"]),
            Part("K'", substitute, ["f_en", "w_Q", "u_last"], outputs=["u_k'"]),
            Part("u", blender(), ["w_Q", "u_k", "u_k'"]),
        ]


STRATEGIES: dict[str, Callable[[Strategies], list[Part]]] = {
    "reference": Strategies._reference,
    "A": Strategies._repetitive,
    "B": Strategies._estimated,
    "C": Strategies._removed,
    "K_prime": Strategies._replaced,
}
"""Functions that return the parts of each strategy."""


def clean_level(laboratory: Laboratory, reflectivity: float = 1.0) -> float:
    """Level of the diodes' sum on a clean disc [V]."""
    drive = laboratory.parameters
    return reflectivity * drive.K_opt / drive.K_optn
