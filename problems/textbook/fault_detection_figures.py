"""Figures of fault detection: step responses of the residuals, and errors over frequency."""

from __future__ import annotations

from typing import Any

from workbench import figures
from workbench.types import Dataset, Figure

LOOKS = {"exact": (figures.ORANGE, "exact isolation"), "approximate": (figures.BLUE, "least error")}
TITLES = {
    "f_u1": "fault of actuator 1",
    "f_u2": "fault of actuator 2",
    "u1": "control 1",
    "u2": "control 2",
}


def steps(answer: Dataset) -> Figure:
    """Residuals after unit steps, for the nominal and the uncertain plants."""
    rows, columns = answer["residual"].values, answer["input"].values
    figure, panels = figures.axes(2, 4, size=(9.6, 5.0), sharex=True, sharey="row")
    places = [(row, column) for row in rows for column in columns]
    for panel, (row, column) in zip(panels, places, strict=True):
        for name, (colour, label) in LOOKS.items():
            one = answer["step"].sel(generator=name, residual=row, input=column)
            low, high = one.sel(curve="least"), one.sel(curve="most")
            words = f"{label}, uncertain plants"
            look: Any = {"color": colour, "alpha": 0.25, "linewidth": 0.0, "label": words}
            panel.fill_between(answer["time"], low, high, **look)
            panel.plot(answer["time"], one.sel(curve="nominal"), color=colour, label=label)
        if row == rows[0]:
            panel.set_title(TITLES[str(column)], fontsize=10)
        else:
            panel.set_xlabel("time [s]")
        if column == columns[0]:
            panel.set_ylabel(f"residual {row}")
        panel.set_xlim(0.0, float(answer["time"].max()))
    figures.legend_below(figure, panels[0], columns=4)
    return figure


def matching(answer: Dataset) -> Figure:
    """Matching errors over frequency, and the lower bound on the error of any generator."""
    figure, (panel,) = figures.axes(1, 1, size=(7.0, 4.2))
    for name, (colour, label) in LOOKS.items():
        error = answer["error"].sel(generator=name)
        panel.plot(answer["frequency"], error, color=colour, label=label)
    words, norm = "no generator has less", float(answer["norm"])
    panel.plot(answer["frequency"], answer["bound"], "--", color=figures.BLACK, label=words)
    dotted: Any = {"color": figures.BLUE, "linewidth": 0.8, "linestyle": ":"}
    panel.axhline(norm, **dotted, label=f"certified norm {norm:.4f}")
    figures.label(panel, x="frequency [Hz]", y="largest singular value of the error", log="xy")
    figures.legend_below(figure, panel, columns=2)
    return figure
