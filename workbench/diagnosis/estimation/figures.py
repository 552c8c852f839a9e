"""Figures of fault estimation."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import NamedTuple

import numpy as np

from workbench import figures
from workbench._core.heavy_types import Figure, StateSpace
from workbench.mu import frequency_sweep
from workbench.structure import Structure
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response


class RequirementLoop(NamedTuple):
    """The closed loop of one requirement, the blocks that close it, and its band [rad/s].

    Unlike a closed `StateSpace`, it has the name and the band with which it is drawn.
    """

    name: str
    system: StateSpace
    structure: Structure
    band: tuple[float, float]


def channels(loops: Sequence[RequirementLoop]) -> Figure:
    """Mixed mu of each requirement over frequency, in its band."""
    figure, (panel,) = figures.axes(1, 1, size=(7.2, 4.6))
    for loop, colour in zip(loops, cycle(figures.CYCLE), strict=False):
        omega = frequencies_of(loop.system)
        omega = omega[(omega >= loop.band[0]) & (omega <= loop.band[1])]
        found = frequency_sweep(loop.system, loop.structure, omega=omega)
        frequency = found.omega / 2 / np.pi
        panel.loglog(frequency, found.upper, color=colour, label=f"{loop.name}, upper bound")
        panel.loglog(frequency, found.lower, ":", color=colour, label="lower bound")
    panel.axhline(1.0, color="0.4", linewidth=0.8)
    panel.set_xlabel("frequency [Hz]")
    panel.set_ylabel("norm over its bound, worst plant")
    figures.legend_below(figure, panel, columns=2)
    return figure


def fault_filter(K: StateSpace) -> Figure:
    """Bode diagram of the filter."""
    omega = frequencies_of(K)
    values = response(K, omega)
    figure, (gain, phase) = figures.axes(2, 1, size=(7.2, 6.0), sharex=True)
    for i in range(K.noutputs):
        for j in range(K.ninputs):
            one = values[:, i, j]
            label = f"{K.input_labels[j]} to {K.output_labels[i]}"
            gain.semilogx(omega / 2 / np.pi, 20 * np.log10(np.abs(one)), label=label)
            phase.semilogx(omega / 2 / np.pi, np.degrees(np.unwrap(np.angle(one))))
    gain.set_ylabel("gain [dB]")
    phase.set_ylabel("phase [deg]")
    phase.set_xlabel("frequency [Hz]")
    if K.noutputs * K.ninputs > 1:
        figures.legend_below(figure, phase, columns=2)
    return figure
