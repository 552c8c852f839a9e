"""Figures of the groups of disturbances.

Figure numbers are those of E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003).
"""

from __future__ import annotations

from workbench import figures
from workbench.types import Dataset, Figure


def groups(answer: Dataset, axis: str) -> Figure:
    """Sensed error from each group alone and from all together, for one drive in one draw."""
    drawn, panels = figures.axes(5, 1, size=(7.2, 8.0), sharex=True)
    for panel, case in zip(panels, answer["case"].values, strict=True):
        panel.plot(1e3 * answer["time"], 1e6 * answer["shown"].sel(case=case))
        figures.label(panel, title=str(case))
    panels[2].set_ylabel(rf"sensed {axis} error [$\mu$m]")
    panels[-1].set_xlabel("time [ms]")
    drawn.suptitle("Figure 2.13: four groups of disturbances, CD1", fontsize=11)
    return drawn


def by_force(answer: Dataset, axis: str, acceptable: float) -> Figure:
    """Force on the lens that causes the acceptable error, over its frequency."""
    drawn, (panel,) = figures.axes(1, 1, size=(7.2, 4.2))
    allowed = 1e3 * acceptable / answer["error_of_force"]
    for n, one in enumerate(allowed.transpose("drive", "frequency")):
        panel.plot(
            answer["frequency"], one, color=figures.BLUE, alpha=0.5, label="" if n else "12 drives"
        )
    for rotation in (9.0, 100.0):
        panel.axvline(rotation, color="0.4", linestyle=":", linewidth=1.0)
    title = f"{axis}: amplitude that costs the acceptable error"
    figures.label(
        panel, x="frequency of the force [Hz]", y="force on the lens [mN]", title=title, log="xy"
    )
    figures.legend_below(drawn, panel)
    return drawn
