"""The named problems of the strangers."""

from __future__ import annotations

from workbench import problem

from .loops import StrangerLoop
from .truth import StrangerTruth


@problem(
    "strangers/{plant}/loop",
    plant=(
        *("heater", "coupled-tanks", "dc-motor", "flexible-arm", "two-mass-drive", "levitation"),
        *("boiler-level", "quadrotor-roll", "hydraulic-cylinder", "disk-arm", "mixing-tank", "ph"),
    ),
    slow=True,
)
def loops(plant: str) -> StrangerLoop:
    """A plant that the workbench never saw, from its loggers' files to C in its nonlinear loop.

    Records of every unit go through `workbench init` and `workbench run` in an empty folder, and
    a C compiler. The C file then drives each nonlinear unit through a step and a load. Promises
    are compared with the true linear plants, the loop with what was demanded beforehand, and the
    certified bandwidth with that of a SIMC controller which knows the true nominal.
    """
    return StrangerLoop(plant)


@problem(
    "strangers/{plant}/truth",
    plant=(
        *("heater", "coupled-tanks", "dc-motor", "flexible-arm", "two-mass-drive", "levitation"),
        *("boiler-level", "quadrotor-roll", "hydraulic-cylinder", "disk-arm", "mixing-tank", "ph"),
    ),
)
def truth(plant: str) -> StrangerTruth:
    """The true linear plants of a stranger's units near rest, and a SIMC controller's bandwidth."""
    return StrangerTruth(plant)
