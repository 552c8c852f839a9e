"""Identification of an aged suspension at a start (sections 4.3.1 and 7.1.1).

Section and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from workbench.identification import periodic_response
from workbench.uncertainty import Parameter

from ...drive.tables import Axis, nominal_table
from ...laboratory.coil_current import DEGREES, DISCARDED, FOUND, CoilExperiment
from ...laboratory.experiment import Laboratory
from ...laboratory.unknowns import Told

STEP, AMPLITUDE = 0.5, 1.0
"""Step of the frequencies [Hz], and amplitude [V], of the experiment at a start."""


class Suspension(NamedTuple):
    """Identified spring [N/m] and damper [N s/m] of a suspension, and their relative half-widths.

    The intervals hold the truth with a probability of 99 %, for every k2 within its tolerance.
    """

    k1: float
    b1: float
    k1_off: float
    b1_off: float

    @property
    def parameters(self) -> tuple[Parameter, Parameter]:
        """k1 and b1 as uncertain parameters."""
        return Parameter("k1", self.k1, self.k1_off), Parameter("b1", self.b1, self.b1_off)


@dataclass(frozen=True)
class StartUp:
    """The open-loop experiment at the start of the nominal drive with an aged suspension."""

    axis: Axis
    suspension: float

    @cached_property
    def experiment(self) -> CoilExperiment:
        bench = Laboratory(self.axis, "nominal", suspension=self.suspension)
        return CoilExperiment(bench, STEP, AMPLITUDE)

    def found(self, seed: int) -> Suspension:
        """Suspension found by the start of a seed, with its noise and told values."""
        told, experiment = Told.drawn(self.axis, seed), self.experiment
        mass = experiment.mass * told.mass
        current = experiment.played(seed).corrected(told, experiment.frequency)
        raw = periodic_response(experiment.frequency, current.u, current.v, transients=DISCARDED)
        # An aged resonance is lower than that of a new drive; the dip of v_r/u shows where it is.
        dip = float(experiment.frequency[np.argmin(abs(raw.response[:, 0, 0]))])
        experiment = replace(experiment, resonance=dip)
        settled = experiment.settled(raw, current, mass)
        variance = (DEGREES + 2) / DEGREES * settled.variance[:, 0, 0]
        fit = experiment.fit(settled.response[:, 0, 0], variance, DEGREES, mass)
        names = list(FOUND)
        values = dict(zip(names, fit.values.tolist(), strict=True))
        half = dict(zip(names, fit.half_width.tolist(), strict=True))
        return suspension_of(self.axis, (values["k"], half["k"]), (values["b"], half["b"]))


def suspension_of(
    axis: Axis, spring: tuple[float, float], damper: tuple[float, float]
) -> Suspension:
    """k1 and b1 from lumped values k and b with their half-widths; the link is that of Table 5.2.

    k = k1 k2 / (k1 + k2) (eq. 4.18, inverted) and b = b1 rho^2 + b2 (1 - rho)^2, with rho = k2 /
    (k1 + k2). The half-widths include the effect of k2 and b2 within their tolerances.
    """
    table = nominal_table(axis)
    k2, b2 = table["k2"], table["b2"]

    def parts(k: float, b: float, stiff: float, damp: float) -> tuple[float, float]:
        k1 = k * stiff / (stiff - k)
        rho = stiff / (k1 + stiff)
        return k1, (b - damp * (1 - rho) ** 2) / rho**2

    k1, b1 = parts(spring[0], damper[0], k2.nominal, b2.nominal)
    ends = np.array(
        [
            parts(
                spring[0] + s * spring[1],
                damper[0] + d * damper[1],
                k2.nominal * (1 + t * k2.tolerance),
                b2.nominal * (1 + q * b2.tolerance),
            )
            for s, d, t, q in product((-1, 1), repeat=4)
        ]
    )
    off = abs(ends / [k1, b1] - 1).max(axis=0)
    return Suspension(float(k1), float(b1), float(off[0]), float(off[1]))
