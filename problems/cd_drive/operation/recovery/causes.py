"""Causes of a loss: shocks of the chassis, and defects of the disc."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.errors import UnknownNameError
from workbench.types import RealArray

from ...diagnosis.defect_kinds import SHOCK_DURATION, SHOCK_PEAK, shocks
from ...drive.disc import VELOCITY, Defect, Disc
from ...drive.tables import Axis, red_book
from ...laboratory.bench_setup import RATE
from ...laboratory.experiment import Laboratory

ROTATION = 9.0
"""Rotation frequency [Hz], as at the start of a disc."""
SHARE = 0.1
"""Deviation of the disc over the Red Book's; the search is captured on such discs."""
AT = 0.4
"""Time [s] of the cause; the disc is at full deviation since 0.2 s."""


@dataclass(frozen=True)
class Cause:
    """A shock, or a defect that is met once.

    shock: peak over SHOCK_PEAK, which moves the error close to the acceptable one. length: of a
    defect along the track [m]; depth: share of the light that it takes. false: displacement that
    its light feigns, over the largest acceptable error.
    """

    shock: float = 0.0
    length: float = 0.0
    depth: float = 0.0
    false: float = 0.0


CAUSES = {
    "weak shock": Cause(shock=0.5),
    "shock": Cause(shock=4.0),
    "strong shock": Cause(shock=10.0),
    "scratch": Cause(length=1.2e-3, depth=0.9, false=2.0),
    "burst": Cause(length=2.5e-3, depth=0.9, false=2.0),
    "dark patch": Cause(length=10e-3, depth=1.0),
}
"""Shocks of 10 ms; the scratch of section 8.6; the longest burst whose data the code corrects
(section 2.5.1); and a patch without light. Sizes that the thesis does not print are guesses.
"""


def cause(name: str) -> Cause:
    """A cause by its name. Raises UnknownNameError for another one."""
    if name not in CAUSES:
        raise UnknownNameError("cause", name, CAUSES)
    return CAUSES[name]


def ends(name: str) -> float:
    """Time [s] at which a cause is over."""
    one = cause(name)
    return AT + (SHOCK_DURATION if one.shock else one.length / VELOCITY)


def excitation(bench: Laboratory, name: str, samples: int) -> RealArray:
    """Voltage [V] (N,) that acts on the lens as the cause's shock does."""
    size = cause(name).shock * SHOCK_PEAK[bench.axis]
    return shocks(bench, [(AT, size, SHOCK_DURATION)], samples)


def disc(axis: Axis, rng: np.random.Generator) -> Disc:
    """A disc at a random angle."""
    phase = float(rng.uniform())
    return Disc.along(axis, SHARE * red_book(axis).deviation, rotation=ROTATION, phase=phase)


def defects(axis: Axis, name: str, met: Disc, acceptable: float) -> tuple[Defect, ...]:
    """The cause's defect, met once at the time AT; acceptable: largest error [m]."""
    one = cause(name)
    if not one.length:
        return ()
    angle = float(met.turned(np.array([AT]))[0][0] % 1.0)
    present = (AT - 0.5 / RATE, AT + 0.5 / ROTATION)
    swing = one.false * acceptable
    return (Defect(one.length, angle=angle, depth=one.depth, displacement=swing, present=present),)
