"""The strangers by name."""

from __future__ import annotations

from .machines import ARM, DRIVE, MOTOR
from .motion import CYLINDER, DISK, LEVITATION, ROLL
from .process import ACID, BOILER, HEATER, MIXING, TANKS
from .stranger import Stranger

STRANGERS: dict[str, Stranger] = {
    "heater": HEATER,
    "coupled-tanks": TANKS,
    "dc-motor": MOTOR,
    "flexible-arm": ARM,
    "two-mass-drive": DRIVE,
    "levitation": LEVITATION,
    "boiler-level": BOILER,
    "quadrotor-roll": ROLL,
    "hydraulic-cylinder": CYLINDER,
    "disk-arm": DISK,
    "mixing-tank": MIXING,
    "ph": ACID,
}
