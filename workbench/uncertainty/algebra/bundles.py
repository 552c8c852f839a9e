"""Figures with many members of an uncertain system."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Figure, StateSpace
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response

POINTS = 400
"""Number of frequencies of a curve, in addition to those at resonances of the nominal."""


def bundle(nominal: StateSpace, members: Sequence[StateSpace]) -> Figure:
    """Gain over frequency of the nominal and of members; the largest gain for several channels."""
    omega = frequencies_of(nominal)
    omega = np.union1d(omega, np.geomspace(omega[0], omega[-1], POINTS))
    if nominal.dt:
        omega = omega[omega < np.pi / nominal.dt]
    figure, (panel,) = figures.axes(1, 1)
    for k, member in enumerate(members):
        words = f"{len(members)} random members" if k == 0 else None
        panel.plot(omega, largest_gains(member, omega), color="0.6", linewidth=0.7, label=words)
    panel.plot(omega, largest_gains(nominal, omega), color=figures.BLUE, label="nominal")
    y = "gain" if nominal.issiso() else "largest singular value"
    figures.label(panel, x="angular frequency [rad/s]", y=f"{y} [1]", log="xy")
    figures.legend_below(figure, panel)
    return figure


def largest_gains(system: StateSpace, omega: RealArray) -> RealArray:
    """Largest singular value over frequency."""
    values: RealArray = np.linalg.norm(response(system, omega), 2, axis=(1, 2))
    return np.maximum(values, 1e-300)
