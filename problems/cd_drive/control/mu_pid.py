"""The mu-PID of the thesis designed directly for each form of uncertainty (section 6.3.1).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, figures, problem
from workbench.certificate import EVERY_PERTURBATION
from workbench.mu import performance_sweep
from workbench.study import markdown_table
from workbench.synthesis import LeadLag, MuController, MuSynthesis
from workbench.types import Figure

from ..drive.plants import Gain
from ..drive.plants import controller as reference
from ..drive.shared_parameters import TABLES, Frequencies
from ..drive.tables import Axis
from .controller import Speed
from .design import CoverMethod, UncertaintyForm, cover_of, synthesis_plant, uncertainty
from .lead_lag_gains import UNITS, LeadLagGains

FREQUENCIES = np.geomspace(1.0, 5e4, 240)
"""Frequencies of the curves [Hz]."""


@problem("cd/{axis}/mu-pid", axis=("focus", "radial"), needs=cover_of, data=TABLES)
def mu_pid(
    axis: Axis,
    covered: Run | None = None,
    form: UncertaintyForm = "parametric",
    cover: CoverMethod = "steps",
    gain: Gain = "own",
    frequencies: Frequencies = 400,
    speed: Speed = 1.0,
    random: Annotated[int, Field(ge=0, le=100)] = 2,
) -> MuPid:
    """PI, lead and roll-off of third order with the least certified peak of mu, designed directly.

    The searches start at the reference controller (eq. 6.12 and its radial variant) and at random
    ones around it. No controller of full order is designed and then reduced.

    form: form of the uncertainty. cover, gain, frequencies: those of the circles' and stadiums'
    models. speed: speed of the disc, in multiples of the nominal one. random: number of random
    starts.
    """
    import control

    plant = synthesis_plant(axis, uncertainty(axis, covered), speed)
    K = control.ss(reference(axis))
    return MuPid(plant, start=K, family=LeadLag.of(K)[0], random=random)


@dataclass(frozen=True, eq=False)
class MuPid(MuSynthesis):
    """A lead-lag controller with the least peak, compared with the one from which the search
    starts.
    """

    default_method: ClassVar[str] = "fixed"

    @cached_property
    def reference_peak(self) -> float:
        """Certified upper bound on the peak of mu with the reference controller."""
        assert self.start is not None
        found = self.certified_peak(self.start)
        assert found is not None  # the start stabilises the loop
        return found.upper

    def checks(self, answer: MuController, tolerance: float) -> list[Check]:
        statement = "certified peak over that of the reference controller, less 1"
        excess = answer.upper / self.reference_peak - 1
        beside = Check("reference", statement, excess, 0.0, over=EVERY_PERTURBATION)
        return [*super().checks(answer, tolerance), beside]

    def metrics(self, answer: MuController) -> dict[str, float]:
        gains = LeadLagGains.of(answer.K)
        numbers = {
            f"{name}_hz" if unit == "Hz" else name: float(getattr(gains, name))
            for name, unit in UNITS.items()
        }
        return super().metrics(answer) | numbers | {"peak_reference": self.reference_peak}

    def tables(self, answer: MuController) -> dict[str, str]:
        assert self.start is not None
        both = [LeadLagGains.of(K) for K in (self.start, answer.K)]
        rows = [
            [f"{name.replace('_', ' ')} [{unit}]", *(f"{getattr(each, name):.5g}" for each in both)]
            for name, unit in UNITS.items()
        ]
        rows.append(["zeros [Hz]", *(each.zeros() for each in both)])
        peaks = [f"{peak:.4f}" for peak in (self.reference_peak, answer.upper)]
        rows.append(["certified peak of mu", *peaks])
        return {"gains": markdown_table(["", "reference", "designed"], rows)}

    def figures(self, answer: MuController) -> dict[str, Figure]:
        assert self.start is not None
        figure, (mu, size, phase) = figures.axes(3, 1, size=(7.2, 8.6), sharex=True)
        looks = {"reference": (":", figures.ORANGE), "designed": ("-", figures.BLUE)}
        omega = 2 * np.pi * FREQUENCIES
        for (name, (dash, colour)), K in zip(looks.items(), (self.start, answer.K), strict=True):
            found = performance_sweep(self.plant, K, omega)
            mu.loglog(FREQUENCIES, found.upper, dash, color=colour, label=name)
            response: Any = K(1j * omega)
            size.loglog(FREQUENCIES, np.abs(response), dash, color=colour)
            phase.semilogx(FREQUENCIES, figures.phase(response), dash, color=colour)
        mu.axhline(1.0, color="0.4", linewidth=0.8)
        figures.label(mu, y="$\\mu$ of robust performance")
        figures.label(size, y="$|K|$ [V/unit]")
        figures.label(phase, x="frequency [Hz]", y="$\\arg K$ [deg]")
        figures.legend_below(figure, mu)
        rounds = {k: v for k, v in super().figures(answer).items() if k == "rounds"}
        return {"mu-pid": figure} | rounds
