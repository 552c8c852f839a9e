"""Both loops of a drive over a disc with defects, with five diodes in one record.

A defect dims all diodes alike and moves both readings. Section and equation numbers refer to E.
Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from workbench.simulation import SampledLoop, kernel
from workbench.types import RealArray

from ...drive.disc import Defect, Disc
from ...drive.tables import AXES, Drive
from ...laboratory.bench_setup import NOISE, PERIOD, RATE, optical_noise
from ..bench import LEAST_DIVISOR, NOISE_BAND, electronics, reference_controllers
from ..diodes.light import DIODES, Split, five_diodes, sensor_parameters
from ..paths import TwoAxes

Normaliser = Literal["sum", "D3"]
NORMALISERS: tuple[Normaliser, ...] = get_args(Normaliser)
"""By what the focus loop divides its error."""
MEASUREMENTS = ("f_en", "r_en", "focus sum", "radial sum", "d3")
SPLIT: Split = "along"
"""The line that parts the pupil runs along the track, which is the worse case for D3."""


class DefectRecord(NamedTuple):
    """Measurements (N, 5) and true errors (N, 2) [m]."""

    read: RealArray
    error: RealArray


@dataclass(frozen=True)
class DefectBench:
    """One drive with both reference controllers.

    noise: whether diodes are noisy; D3 has the noise of D1. refine: number of steps per sample in
    which the optics are simulated.
    """

    drive: str
    normaliser: Normaliser = "sum"
    noise: bool = True
    refine: int = 1

    @property
    def axes(self) -> tuple[Drive, Drive]:
        """Entries of Tables A.1 to A.3 of the focus and of the radial axis."""
        return TwoAxes(self.drive).axes

    def over(
        self, disc: Disc, defects: Sequence[tuple[Defect, Defect]], duration: float, seed: int
    ) -> DefectRecord:
        """A record of this duration [s] from rest; each defect as focus and radial loop see it.

        Both loops see the same light, and each its own false displacement.
        """
        samples = round(duration / PERIOD)
        time = np.arange(samples + 1) / RATE
        layer = np.column_stack([disc.deviation(axis, time) for axis in AXES])
        (light, focus), (_, radial) = (
            disc.surface(own, time) for own in zip(*defects, strict=True)
        )
        exogenous = np.column_stack([layer + np.column_stack([focus, radial]), light])
        still, noise = np.zeros((samples, 2)), self._noise(seed, samples)
        found = _loop(self).run(reference_controllers(), still, exogenous, noise)
        return DefectRecord(found.measurement, layer[:-1] - found.position)

    def _noise(self, seed: int, samples: int) -> RealArray:
        if not self.noise:
            return np.zeros((samples, len(DIODES)))
        rng = np.random.default_rng(seed)
        focus, radial, third = (
            optical_noise(rng, samples, self.axes[n], NOISE[AXES[n]], NOISE_BAND) for n in (0, 1, 0)
        )
        return np.hstack([focus, radial, third[:, :1]])


@cache
def _loop(bench: DefectBench) -> SampledLoop:
    return SampledLoop(
        sense=five_diodes,
        sense_parameters=sensor_parameters(bench.drive, SPLIT),
        read=read_five,
        read_parameters=np.array([LEAST_DIVISOR, float(bench.normaliser == "D3")]),
        measurements=len(MEASUREMENTS),
        **electronics(TwoAxes(bench.drive), len(DIODES), bits=12),
        refine=bench.refine,
    )


@kernel
def read_five(channels: RealArray, parameters: RealArray, measurement: RealArray) -> None:
    """The processor's reading of DIODES (eq. 3.16, 3.17): MEASUREMENTS.

    Parameters: least divisor [V], and 1 if the focus error is divided by D3.
    """
    d1, d2, s1, s2, d3 = channels[0], channels[1], channels[2], channels[3], channels[4]
    divisor = d3 if parameters[1] == 1.0 else d1 + d2
    measurement[0] = (d1 - d2) / max(divisor, parameters[0])
    measurement[1] = (s1 - s2) / max(s1 + s2, parameters[0])
    measurement[2] = d1 + d2
    measurement[3] = s1 + s2
    measurement[4] = d3


def level_of(read: RealArray, inside: NDArray[np.bool_]) -> RealArray:
    """Sums of both axes (2,) [V] where no defect is."""
    level: RealArray = read[~inside, 2:4].mean(axis=0)
    return level
