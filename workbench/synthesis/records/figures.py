"""Figure of the loops of a gain with plants drawn from the set that agrees with the records."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Axes, Figure
from workbench.second_opinion import recorded_plants as drawn
from workbench.synthesis.records.inequalities import ProvenFeedback
from workbench.synthesis.records.trials import DrawnQuestion

SAMPLES = 30
"""Number of samples over which the decrease of the Lyapunov function is drawn."""
FREQUENCIES = 200
"""Number of frequencies of the responses."""


def loops(question: DrawnQuestion, answer: ProvenFeedback) -> Figure:
    """Open-loop and closed-loop poles of drawn plants, and each closed loop compared with the
    level.
    """
    records, noise = question.records, question.records.noise
    after = records.next_states - (0.0 if noise.mean is None else noise.mean)
    centre, left, right = drawn.edge_plants(records.regressors, after, noise.weight, noise.energy)
    theta = centre + drawn.drawn_changes(left, right)
    closed = theta @ np.vstack([np.eye(records.order), answer.K])
    figure, (plane, levels) = figures.axes(1, 2, size=(9.0, 4.2))
    _poles(plane, theta[:, :, : records.order], closed)
    if question.criterion == "decay":
        angle = np.linspace(0.0, 2 * np.pi, 200)
        circle = answer.level * np.exp(1j * angle)
        plane.plot(circle.real, circle.imag, "--", color=figures.BLUE, label="proven rate")
        _decrease(levels, closed, answer)
    elif question.criterion == "h2":
        _norms(levels, closed, question, answer)
    else:
        _responses(levels, closed, question, answer)
    figures.legend_below(figure, plane)
    return figure


def _poles(panel: Axes, opened: RealArray, closed: RealArray) -> None:
    """Poles without and with the feedback, and the unit circle."""
    angle = np.linspace(0.0, 2 * np.pi, 200)
    panel.plot(np.cos(angle), np.sin(angle), color="0.4", linewidth=0.8)
    looks = (opened, "0.6", "x", "plants of the set"), (closed, figures.ORANGE, ".", "their loops")
    for matrices, colour, marker, name in looks:
        poles = np.linalg.eigvals(matrices).ravel()
        panel.plot(
            poles.real, poles.imag, marker, color=colour, markersize=3, label=name, linestyle=""
        )
    panel.set_aspect("equal", adjustable="datalim")
    figures.label(panel, x="real part of a pole [1]", y="imaginary part [1]")


def _decrease(panel: Axes, closed: RealArray, answer: ProvenFeedback) -> None:
    """Square root of the largest x' P x of each loop, relative to its first value, over time."""
    root = np.linalg.cholesky(np.linalg.inv(answer.Y)).T
    back = np.linalg.inv(root)
    time, power = np.arange(SAMPLES + 1), np.broadcast_to(np.eye(len(back)), closed.shape)
    sizes = []
    for _ in time:
        sizes.append(np.linalg.norm(root @ power @ back, 2, axis=(1, 2)))
        power = closed @ power
    panel.semilogy(time, np.array(sizes), color=figures.ORANGE, linewidth=0.4, alpha=0.5)
    panel.semilogy(time, answer.level**time, "--", color=figures.BLUE)
    figures.label(panel, x="time [samples]", y=r"$\sqrt{x^{\top} P x}$ over its first value [1]")


def _norms(panel: Axes, closed: RealArray, question: DrawnQuestion, answer: ProvenFeedback) -> None:
    """Share of the drawn loops whose H2 norm is at most a value."""
    (C, D), F = question.performance, question.disturbance
    sizes = np.sort([drawn.largest_h2(loop[None], F, C + D @ answer.K) for loop in closed])
    panel.step(sizes, np.arange(1, len(sizes) + 1) / len(sizes), color=figures.ORANGE)
    panel.axvline(answer.level, linestyle="--", color=figures.BLUE)
    figures.label(panel, x="H2 norm of a loop, proven level dashed", y="share of the loops [1]")


def _responses(
    panel: Axes, closed: RealArray, question: DrawnQuestion, answer: ProvenFeedback
) -> None:
    """Largest singular value of each loop over frequency."""
    C, D = question.performance
    angle = np.linspace(0.0, np.pi, FREQUENCIES)
    gains = drawn.gains(closed, question.disturbance, C + D @ answer.K, np.exp(1j * angle))
    panel.plot(angle, gains.T, color=figures.ORANGE, linewidth=0.4, alpha=0.5)
    panel.axhline(answer.level, linestyle="--", color=figures.BLUE)
    figures.label(panel, x="frequency [rad per sample]", y="gain from v to z, proven level dashed")
