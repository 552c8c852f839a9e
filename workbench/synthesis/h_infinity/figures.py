"""Figures of a synthesised loop: singular values over frequency."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from workbench import figures
from workbench._core.heavy_types import Axes, Figure, StateSpace
from workbench.answer import ProgramAnswer
from workbench.systems.generalised_plant import response

GRID_POINTS = 400
"""Number of frequencies of a curve."""
SMALLEST_SHARE = 1e-6
"""Singular values below this share of the largest one are not shown."""
DECADES_BEYOND = 1.5
"""Decades shown beyond the slowest and the fastest pole."""


def loop(closed: StateSpace, gamma: float | None = None) -> Figure:
    """Figure of the singular values of the closed loop, with the level gamma if there is one."""
    figure, (panel,) = figures.axes(1, 1)
    _singular_values(panel, closed, grid(closed))
    if gamma is not None:
        panel.axhline(gamma, color=figures.BLACK, linestyle="--", label="level gamma")
    figures.label(panel, y="singular values of the closed loop [1]")
    figures.legend_below(figure, panel)
    return figure


def controller(K: StateSpace, closed: StateSpace, unit: str = "") -> Figure:
    """Figure of the singular values of K (|K| of a scalar K) over the frequencies of the loop."""
    figure, (panel,) = figures.axes(1, 1)
    _singular_values(panel, K, grid(closed))
    if K.issiso():
        figures.label(panel, y=f"$|K|$ [{unit}]" if unit else "$|K|$")
        return figure
    figures.label(panel, y="singular values of $K$")
    figures.legend_below(figure, panel)
    return figure


class DrawnController(ProgramAnswer, ABC):
    """Base of answers that are controllers: it draws them.

    Unlike a `StateSpace`, it is an answer with checks and figures.
    """

    @property
    @abstractmethod
    def lti(self) -> StateSpace:
        """The controller."""

    def plot(self, name: str | None = None) -> Figure:
        """Bode plot of the controller or filter, or singular values of one of several channels.

        With a name, the figure of this name of its Program.
        """
        if name is not None:
            return super().plot(name)
        K = self.lti
        if not K.issiso():
            return controller(K, K)
        omega = grid(K)
        values = response(K, omega)[:, 0, 0]
        return figures.bode_plot(omega / (2 * np.pi), {"controller": values}, "1")


def grid(closed: StateSpace) -> np.ndarray:
    """Frequencies [rad/s] around the poles of a loop, at most half the sampling rate."""
    poles = closed.poles()
    if closed.dt:
        poles = np.log(poles[np.abs(poles) > 0]) / closed.dt
    size = np.abs(poles)
    size = np.quantile(size[size > 0], [0.05, 0.95]) if (size > 0).any() else np.ones(2)
    low, high = np.log10(size) + np.array([-DECADES_BEYOND, DECADES_BEYOND])
    top = np.log10(np.pi / closed.dt) if closed.dt else high
    return np.logspace(min(low, top - 2.0), min(high, top), GRID_POINTS)


def _singular_values(panel: Axes, system: StateSpace, omega: np.ndarray) -> None:
    """Draw the singular values of a system's response that are not negligible beside the
    largest.
    """
    values = np.linalg.svd(response(system, omega), compute_uv=False)
    largest = max(float(values.max()), 1e-290)
    seen = values[:, values.max(axis=0) > SMALLEST_SHARE * largest]
    for k, row in enumerate(seen.T):
        panel.loglog(omega / (2 * np.pi), np.maximum(row, 1e-300), label=rf"$\sigma_{{{k + 1}}}$")
    panel.set_ylim(max(float(seen.min()), SMALLEST_SHARE * largest) / 2, 3 * largest)
    figures.label(panel, x="frequency [Hz]")
