"""Each group of disturbances alone, and all together, in a noise-free laboratory (figure 2.13).

Equation and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from workbench.simulation import discrete_system, linear_controller
from workbench.types import RealArray

from ...drive.disc import Defect, Disc
from ...drive.plants import ANTIALIASING, controller
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis, red_book
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import Laboratory
from ...laboratory.record import Record
from ..defect_kinds import SHOCK_DURATION, SHOCK_PEAK, shocks, voltage_of_force
from ..defect_runs import ROTATION
from .pollution import SelfPollution

GROUPS = ("disc deviations", "mechanical disturbances", "self-pollution", "surface defects")
"""The groups of section 2.5.1."""
CASES = (*GROUPS, "all together")
"""Runs: every group alone, and all of them."""
MET = 0.4
"""Time [s] from which the disturbances are evaluated; the disc has run up before."""
DURATION = 50e-3
"""Duration [s] for which they are evaluated."""
DISC = 0.03
"""Share of the Red Book's deviation at which all errors together stay in the diodes' linear range.
"""
SHOCK, SHIFT = 0.1, 0.1
"""Shock, over the one that moves the error close to the acceptable one; and largest false
displacement of a scratch, over the acceptable error.
"""


class Superposed(NamedTuple):
    """Errors of each of CASES, and how well they superpose.

    error (5, N): true error [m]. sensed (5, N): normalised error over K_optn [m]. superposition:
    largest difference of the last sensed error from the sum of the others, relative. equation_2_9:
    the same for its difference from the right-hand side of equation 2.9.
    """

    error: RealArray
    sensed: RealArray
    superposition: float
    equation_2_9: float


@dataclass(frozen=True)
class Disturbed:
    """A drive with a draw of every group of disturbances."""

    axis: Axis
    drive: str
    seed: int

    @property
    def bench(self) -> Laboratory:
        """The laboratory without noise and without the steps of its converters."""
        return Laboratory(self.axis, self.drive, noise=0.0, electronics=0.0, bits=None)

    def met(self) -> Superposed:
        """Run every case."""
        records = [self._record(case) for case in CASES]
        start = round(MET * RATE)
        K_optn = self.bench.parameters.K_optn
        error = np.array([(one.x_cd - one.x)[start:] for one in records])
        sensed = np.array([one.f_en[start:] / K_optn for one in records])
        whole = sensed[-1]
        size = float(abs(whole).max())
        added = float(abs(whole - sensed[:-1].sum(axis=0)).max()) / size
        expected = _filtered(records[-1])[start:]
        return Superposed(error, sensed, added, float(abs(whole - expected).max()) / size)

    def _record(self, case: str) -> Record:
        """The run of one case: the same draws, without the other groups."""
        rng, bench = np.random.default_rng(self.seed), self.bench
        samples = round((MET + DURATION) * RATE)
        phase, sign = rng.uniform(), rng.choice([-1.0, 1.0], size=2)
        peak = sign[0] * rng.uniform(0.3, 1.0) * SHOCK * SHOCK_PEAK[self.axis]
        shaken = shocks(bench, [(MET + rng.uniform(0, 10e-3), peak, SHOCK_DURATION)], samples)
        pollution = SelfPollution.drawn(rng, self.axis, MET)
        time = np.arange(samples) / RATE
        force = pollution.force(self.axis, bench.parameters, time, ROTATION)
        scratch = Defect(
            length=rng.uniform(0.5e-3, 1.5e-3),
            angle=(ROTATION * (MET + rng.uniform(10e-3, 20e-3)) + phase) % 1.0,
            depth=rng.uniform(0.2, 0.6),
            displacement=sign[1] * rng.uniform(0.3, 1.0) * SHIFT * ACCEPTABLE_ERROR[self.axis],
            present=(MET, np.inf),
        )
        in_it = {name: case in (name, CASES[-1]) for name in GROUPS}
        deviation = DISC * red_book(self.axis).deviation * in_it[GROUPS[0]]
        excitation = shaken * in_it[GROUPS[1]]
        excitation = excitation + voltage_of_force(bench) * force * in_it[GROUPS[2]]
        return bench.closed_loop(
            linear_controller(controller(self.axis), PERIOD),
            excitation,
            disc=Disc.along(self.axis, deviation, rotation=ROTATION, phase=phase),
            defects=[scratch] if in_it[GROUPS[3]] else [],
        )


def _filtered(record: Record) -> RealArray:
    """-x + x_cd + f_sd [m] (N,) after the anti-aliasing filter, linear between samples."""
    error = -record.x + record.x_cd + record.f_sd
    a = ANTIALIASING * PERIOD
    left = np.exp(-a)
    # The exact response of the filter to a piecewise linear signal.
    new = 1.0 - (1.0 - left) / a
    old = (1.0 - left) / a - left
    filtered: RealArray = lfilter([new, old], [1.0, -left], error)
    return filtered


def error_of_force(axis: Axis, drive: str, frequency: ArrayLike) -> RealArray:
    """|error / force| [m/N] (F,) of the reference loop at frequencies [Hz] (F,)."""
    bench = Laboratory(axis, drive)
    z = np.exp(2j * np.pi * np.asarray(frequency, float) * PERIOD)
    response = bench.response(frequency)
    K = discrete_system(controller(axis), PERIOD)(z, squeeze=False)[0, 0]
    moved: RealArray = abs(response["x"] * voltage_of_force(bench) / (1 - K * response["f_en"]))
    return moved
