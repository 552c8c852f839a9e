"""K', a single controller of lower bandwidth for the time of a defect (section 8.5, figure 8.6).

The thesis forms it from the controller K and a filter, K' = K (1 - F), and finds it nearly unstable
(figure 8.10). It mentions that K' could be designed directly in the mu framework, but does not do
it. Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, figures, problem
from workbench.certificate import EVERY_PERTURBATION, THIS_SYSTEM
from workbench.mu import conditions
from workbench.synthesis import (
    LeadLag,
    MuController,
    MuSynthesis,
    closed_loop_transition,
    discretise,
)
from workbench.systems import loop_response, stored_system
from workbench.types import Dataset, Figure, StateSpace

from ..control.control_problem import SIGNAL_UNITS
from ..control.loops import plants
from ..control.trade_off import CHANNELS, TradeOff
from ..drive.photo_diodes import CAPTURE
from ..drive.plants import controller as reference
from ..drive.red_book import ACCEPTABLE_ERROR
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis
from ..laboratory.bench_setup import PERIOD

THIRD = 1 / 3
"""Gain of the start relative to eq. 6.12, as in figure 6.7."""
ROLL_OFF = 2000.0
"""Frequency [Hz] from which |K' S| must decrease."""
FLAT_RATIO = 50.0
"""The weight of K' S is flat from FLAT_RATIO * ROLL_OFF, so that it is proper."""
FREQUENCY = np.geomspace(1.0, 17.5e3, 300)
"""Frequencies [Hz] of the figure."""
DEFECT_FREQUENCY = np.geomspace(1000.0, 17.5e3, 300)
"""Frequencies [Hz] of surface defects, at which K and K' are compared."""


@problem("cd/{axis}/lower-bandwidth", axis=("focus", "radial"), data=TABLES)
def lower_bandwidth(
    axis: Axis,
    defect_mm: Annotated[float, Field(gt=0, le=100)] = 2.5,
    share: Annotated[float, Field(gt=0, le=1000)] = 3.0,
    start: Annotated[float, Field(gt=0, le=10)] = THIRD,
) -> LowerBandwidth:
    """K', the lower-bandwidth controller of figure 8.6, by mu synthesis of third order.

    Least certified peak of mixed mu over the parametric set (Table 5.3), from the disc's deviation
    w to three channels:

    - W_p / relaxed of S, eq. 6.11, relaxed = capture range over acceptable error (3 in focus):
      while a defect passes the error may reach the ends of the s-curve, not only 2 um;
    - share W_sd of T, W_sd = (s / (s + w_d))^3, w_d = 2 pi v / length: the lens may follow at most
      1 / share of the false displacement by a defect of that length;
    - W_u of K' S, 1 / (100 K_optn) as section 6.3 up to 2 kHz and rising in proportion beyond, so
      that K' falls off well below half the sampling frequency of 35 kHz.

    A peak below 1 means that all three requirements hold for all plants of the set at once. With
    share = 3, the default, focus just reaches that; a larger share leaves less bandwidth than the
    Red Book's deviations need. The controller has PI, lead and roll-off as in eq. 6.12, and the
    search starts from a third of its gain.

    defect_mm: length of the longest defect [mm]; 2.5 is what the error correction repairs. share:
    weight of defects. start: gain of the start relative to the reference controller.
    """
    import control

    K = start * control.ss(reference(axis))
    plant = TradeOff(axis, defect_mm / 1e3).uncertain.channel(performance=CHANNELS, exogenous="w")
    relaxed = CAPTURE[axis] / ACCEPTABLE_ERROR[axis]
    weights = [1 / relaxed, share, roll_off()]
    return LowerBandwidth(
        plant.weighted(performance=weights),
        start=K,
        family=LeadLag.of(K)[0],
        axis=axis,
        units=SIGNAL_UNITS,
    )


def roll_off() -> StateSpace:
    """Frequency-dependent factor of W_u: 1 up to ROLL_OFF, then rising in proportion to
    frequency.
    """
    import control

    corner = 2 * np.pi * ROLL_OFF
    ratio = FLAT_RATIO
    return control.ss(-ratio * corner, corner * ratio * (1 - ratio), 1.0, ratio)


@dataclass(frozen=True, eq=False)
class LowerBandwidth(MuSynthesis):
    """K' and its sampled form, compared with the reference controller."""

    axis: Axis = "focus"

    default_method: ClassVar[str] = "fixed"

    def checks(self, answer: MuController, tolerance: float) -> list[Check]:
        mu, radius = self.robust_stability(answer), self.sampled_radius(answer.K)
        T, reference_T = (self.defect_gain(K) for K in (answer.K, self.reference))
        robust = "upper bound of mu of robust stability over the parametric set"
        sampled = "largest pole in modulus of the nominal loop of the sampled controller"
        immune = "largest |T| for defects over that of the reference controller"
        return [
            *super().checks(answer, tolerance),
            Check("robust stability", robust, mu, 1.0, over=EVERY_PERTURBATION),
            Check("sampled", sampled, radius, 1.0, over=THIS_SYSTEM),
            Check("immunity", immune, T / reference_T, 0.5, over="for the nominal loop"),
        ]

    @property
    def reference(self) -> StateSpace:
        import control

        return control.ss(reference(self.axis))

    def robust_stability(self, answer: MuController) -> float:
        """Upper bound of mu over all frequencies; infinite for an unstable nominal loop.

        Robust performance below 1 implies it, so a separate computation is needed only for a larger
        peak.
        """
        if answer.upper < 1:
            return answer.upper
        peak = conditions(self.plant, answer.K).robust_stability
        return np.inf if peak is None else peak.upper

    def sampled_radius(self, K: StateSpace) -> float:
        """Largest modulus of the sampled nominal loop's poles, with one sample of delay."""
        nominal = plants(self.axis, "own", "printed")["nominal"]
        return float(
            abs(
                np.linalg.eigvals(closed_loop_transition(nominal, discretise(K, PERIOD), 1.0))
            ).max()
        )

    def responses(self, K: StateSpace, frequency: Any) -> tuple[Any, Any]:
        """S and T of the nominal loop at frequencies [Hz]."""
        L = loop_response(TradeOff(self.axis, 1.0).G * K, frequency)
        return 1 / (1 + L), L / (1 + L)

    def defect_gain(self, K: StateSpace) -> float:
        """Largest |T| at the frequencies of surface defects."""
        return float(abs(self.responses(K, DEFECT_FREQUENCY)[1]).max())

    def metrics(self, answer: MuController) -> dict[str, float]:
        found = super().metrics(answer)
        for name, K in {"": answer.K, "_reference": self.reference}.items():
            found[f"T_defects{name}"] = self.defect_gain(K)
        return found

    def to_dataset(self, answer: MuController) -> Dataset:
        sampled = discretise(answer.K, PERIOD)
        return super().to_dataset(answer).assign(stored_system("sampled", sampled))

    def figures(self, answer: MuController) -> dict[str, Figure]:
        figure, panels = figures.axes(3, 1, size=(7.2, 8.6), sharex=True)
        looks = {"K, reference": (self.reference, "-", figures.BLUE)}
        looks["K', lower bandwidth"] = (answer.K, "--", figures.ORANGE)
        for name, (K, dash, colour) in looks.items():
            response: Any = K(2j * np.pi * FREQUENCY)
            curves = (response, *self.responses(K, FREQUENCY))
            for panel, curve in zip(panels, curves, strict=True):
                panel.plot(FREQUENCY, abs(curve), dash, color=colour, label=name)
        for panel, words in zip(panels, ("$|K|$ [V/unit]", "$|S|$ [1]", "$|T|$ [1]"), strict=True):
            figures.label(
                panel, x="frequency [Hz]" if panel is panels[-1] else "", y=words, log="xy"
            )
        figures.legend_below(figure, panels[0])
        return super().figures(answer) | {"lower-bandwidth": figure}
