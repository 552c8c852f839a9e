"""Figures of the page "Is my record good enough?": python docs/_tools/records.py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import lfilter

from workbench import figures
from workbench.identification import driven_response, local_response

START = Path(__file__).parents[1] / "start"
DT = 0.1


def loop(rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Input, output and set-point (2000,) of a plant under proportional control."""
    r = np.repeat(rng.standard_normal(200), 10) * 3
    disturbance = lfilter([0.3], [1.0, -0.95], rng.standard_normal(2000))
    x, u, y = 0.0, np.zeros(2000), np.zeros(2000)
    for k in range(2000):
        y[k] = x + disturbance[k]
        u[k] = r[k] - 2.0 * y[k]
        x = 0.8 * x + 0.2 * u[k]
    return u, y, r


def records_figure() -> Any:
    """Outputs of four records."""
    rng = np.random.default_rng(0)
    u = np.repeat(rng.choice([-1.0, 1.0], 500), 4)
    y = lfilter([0.0, 0.2], [1.0, -0.8], u) + 0.05 * rng.standard_normal(2000)
    flagged = y.copy()
    flagged[[30, 31, 80]] = -99.0
    shown = {
        "good: usable": y,
        "flags: forbidden": flagged,
        "clipped: a finding": np.clip(y, -0.5, 0.5),
        "closed loop: forbidden without the set-point": loop(rng)[1],
    }
    figure, panels = figures.axes(4, 1, size=(7.0, 7.0), sharex=True)
    time = np.arange(150) * DT
    for panel, (name, values) in zip(panels, shown.items(), strict=True):
        panel.plot(time, values[:150])
        panel.set_title(name, loc="left")
        figures.label(panel, y="output")
    figures.label(panels[-1], x="time [s]")
    return figure


def loop_figure() -> Any:
    """The plant, its estimate as if the loop were open, and by the excitation."""
    u, y, r = loop(np.random.default_rng(1))
    driven = driven_response(u, y, r, DT)
    plain = local_response(
        u[:, None],
        y[:, None],
        DT,
    )
    exact = 0.2 / (np.exp(1j * DT * driven.omega) - 0.8)
    figure, (panel,) = figures.axes(1, 1, size=(7.0, 4.0))
    size, reach = np.abs(driven.response[:, 0, 0]), driven.radius(confidence=0.95)[:, 0, 0]
    low = size - np.maximum(size - reach, size / 100)  # a bar down to 0 has no end to be seen
    panel.errorbar(driven.frequency_hz, size, [low, reach], fmt=".", markersize=4, linewidth=0.8,
                   label="by the set-point, with 95 % regions")  # fmt: skip
    panel.plot(plain.frequency_hz, np.abs(plain.response[:, 0, 0]), ".", markersize=3,
               color=figures.ORANGE, label="as if the loop were open")  # fmt: skip
    panel.plot(driven.frequency_hz, np.abs(exact), "k--", linewidth=1, label="the plant")
    panel.axhline(0.5, color="grey", linewidth=1, linestyle=":", label="1 / |K|")
    panel.set_ylim(0.02, 5.0)
    figures.label(panel, x="frequency [Hz]", y="magnitude", log="xy")
    panel.legend(frameon=False, loc="lower left")
    return figure


if __name__ == "__main__":
    for name, make in {"good-records": records_figure, "driven": loop_figure}.items():
        make().savefig(START / f"{name}.svg", format="svg")
