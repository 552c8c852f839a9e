"""Figures of margins: Nyquist curves with the disks that they avoid, gains with phases."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from workbench import figures
from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import Figure, StateSpace
from workbench.mu.margins.disk import DiskMargin
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response
from workbench.uncertainty.algebra.rational_delays import rational_part
from workbench.uncertainty.algebra.system import UncertainSystem

POINTS = 400
"""Number of points on a curve. Corners of less than a degree are not seen at the size of a page.
Half shows corners in an enlarged figure; double makes files twice as large.
"""
SHOWN = 3.0
"""Half-width of the Nyquist figure, in units of L. It shows the unit circle and disks about -1 with
some room. Half or double shows less, or smaller.
"""
MOST_DB = 40.0
"""Largest gain [dB] of the region of gains and phases. It is a factor of 100, beyond any use. Half
or double shows less, or smaller.
"""


def figure_of(
    loops: Mapping[str, StateSpace | UncertainSystem],
    disks: Mapping[str, DiskMargin],
    together: DiskMargin | None,
    members: Sequence[StateSpace],
) -> Figure:
    """Nyquist curves of each channel, with its disk if it has one; tolerated gains and phases.

    ``together`` is the disk of all channels at once, and ``members`` are loops of random plants.
    """
    figure, (plane, region) = figures.axes(1, 2)
    angles = np.linspace(0.0, 2 * math.pi, POINTS)
    for number, loop in enumerate(members):
        curve = _curve(loop)
        words = f"{len(members)} random plants" if number == 0 else None
        plane.plot(curve.real, curve.imag, color="0.7", linewidth=0.6, label=words)
    for name, loop in loops.items():
        curve = _curve(loop)
        (line,) = plane.plot(curve.real, curve.imag, label=name)
        colour = line.get_color()
        disk = disks.get(name)
        if disk is not None and 0 < disk.lower < math.inf:
            f = _boundary(disk.lower, disk.skew, angles)
            avoided = -1.0 / f
            plane.plot(avoided.real, avoided.imag, "--", color=colour, linewidth=1.0)
            _gains_and_phases(region, f, color=colour)
    if together is not None and 0 < together.lower < math.inf:
        f = _boundary(together.lower, together.skew, angles)
        _gains_and_phases(region, f, color=figures.BLACK)
        plane.plot([], [], color=figures.BLACK, label="all channels at once")
    plane.plot([-1.0], [0.0], "+", color=figures.BLACK)
    plane.set_xlim(-SHOWN, SHOWN)
    plane.set_ylim(-SHOWN, SHOWN)
    plane.set_aspect("equal")
    figures.label(
        plane, x="real part of L [1]", y="imaginary part of L [1]", title="L, and disks it avoids"
    )
    figures.label(region, x="phase [deg]", y="gain [dB]", title="what a channel bears")
    figures.legend_below(figure, plane)
    return figure


def measured_figure(values: ComplexArray, radius: RealArray | None) -> Figure:
    """Nyquist curve of measured responses (F,), with discs of these radii (F,) about them."""
    figure, (plane,) = figures.axes(1, 1)
    angles = np.linspace(0.0, 2 * math.pi, POINTS)
    plane.plot(np.cos(angles), np.sin(angles), ":", color="0.5", label="unit circle")
    (line,) = plane.plot(values.real, values.imag, ".-", label="data")
    for number, (value, size) in enumerate(
        zip(values, radius if radius is not None else (), strict=False)
    ):
        disc = value + size * np.exp(1j * angles)
        words = "95 % of the noise" if number == 0 else None
        plane.plot(disc.real, disc.imag, color=line.get_color(), linewidth=0.5, label=words)
    plane.plot([-1.0], [0.0], "+", color=figures.BLACK)
    plane.set_xlim(-SHOWN, SHOWN)
    plane.set_ylim(-SHOWN, SHOWN)
    plane.set_aspect("equal")
    figures.label(plane, x="real part of L [1]", y="imaginary part of L [1]", title="measured L")
    figures.legend_below(figure, plane)
    return figure


def _curve(loop: StateSpace | UncertainSystem) -> ComplexArray:
    """The response over frequency, without parts far outside the figure."""
    late = loop if isinstance(loop, UncertainSystem) else None
    omega = frequencies_of(rational_part(late)[1].nominal if late else loop)
    omega = omega[(omega > 0) & np.isfinite(omega)]
    low, high = (omega[0] / 10, omega[-1] * 10) if omega.size else (1e-3, 1e3)
    if loop.dt:
        high = math.pi / loop.dt
    omega = np.union1d(omega[omega <= high], np.geomspace(low, high, 4 * POINTS))
    with np.errstate(all="ignore"):
        values = (late.response(omega) if late else response(loop, omega))[:, 0, 0]
    return np.where(np.abs(values) < 1e3 * SHOWN, values, np.nan)


def _boundary(alpha: float, skew: float, angles: Any) -> ComplexArray:
    """Factors on the boundary of a disk."""
    delta = alpha * np.exp(1j * angles)
    with np.errstate(all="ignore"):
        f: ComplexArray = (1 + (1 - skew) / 2 * delta) / (1 - (1 + skew) / 2 * delta)
    return f


def _gains_and_phases(region: Any, f: ComplexArray, **style: Any) -> None:
    """The boundary of a disk as gain [dB] over phase [deg]."""
    gain, phase = 20 * np.log10(np.abs(f)), np.degrees(np.angle(f))
    shown = np.isfinite(gain) & (np.abs(gain) <= MOST_DB)
    region.plot(np.where(shown, phase, np.nan), np.where(shown, gain, np.nan), **style)
