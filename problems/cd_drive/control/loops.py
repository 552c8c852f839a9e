"""Open loops of the twelve drives with the reference controller, L = K G AAF.

They are in continuous time, or sampled: then the plant has a zero-order hold, and the controller is
discretised by the bilinear transform. Section numbers refer to E. Vidal Sanchez, Robust and Fault
Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from workbench.simulation import sampled_model
from workbench.types import StateSpace

from ..drive.plants import Gain, controller, nominal_parameters, plant, total_gain, total_gains
from ..drive.tables import Axis, Values, drives
from ..laboratory.bench_setup import PERIOD

SCALES = {"full": 1.0, "third": 1 / 3}
"""Gains of the controller in figure 6.6, relative to eq. 6.12."""


def plants(axis: Axis, gain: Gain, values: Values) -> dict[str, StateSpace]:
    """The twelve drives by equation 3.18, and the nominal one last, by name."""
    twelve = drives(axis, values)
    gains = total_gains(axis, twelve, [drive.K_optn for drive in twelve], gain)
    systems = {drive.name: plant(drive, float(K)) for drive, K in zip(twelve, gains, strict=True)}
    return systems | {"nominal": plant(nominal_parameters(axis), total_gain(axis))}


def open_loop(axis: Axis, system: StateSpace, delay: float | None = None) -> StateSpace:
    """L of a plant. It is sampled if a delay [samples] beyond that of the hold is
    given, 0 or more.
    """
    import control

    K = control.ss(controller(axis))
    if delay is None:
        return system * K
    return sampled_model(system, PERIOD, delay_samples=delay) * control.sample_system(
        K, PERIOD, "bilinear"
    )
