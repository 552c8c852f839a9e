"""One change in every way, and the errors after many."""

from __future__ import annotations

from workbench import figures
from workbench.types import Dataset, Figure

from ...drive.photo_diodes import CAPTURE
from ...drive.tables import Axis


def one_change(answer: Dataset, axis: Axis) -> Figure:
    """Error and command for every way of changing, one record on CD1."""
    ways = answer["way"].values.tolist()
    drawn, panels = figures.axes(2, len(ways), size=(10.0, 5.0), sharex=True, sharey="row")
    time = 1e3 * answer["time"]
    for above, below, way in zip(panels, panels[len(ways) :], ways, strict=False):
        above.plot(time, 1e6 * answer["shown_error"].sel(way=way), color=figures.BLUE)
        below.plot(time, answer["shown_u"].sel(way=way), color=figures.ORANGE)
        above.set_title(way)
        for panel in (above, below):
            panel.axvline(0.0, color="0.4", linewidth=0.8)
        figures.label(below, x="time from the change [ms]")
    figures.label(panels[0], y=rf"true {axis} error [$\mu$m]")
    figures.label(panels[len(ways)], y="u [V]")
    return drawn


def after_change(answer: Dataset, axis: Axis, milliseconds: float) -> Figure:
    """Largest error after a change over the disc's angle, and after a step alone."""
    shares = answer["share"].values
    drawn, panels = figures.axes(1, len(shares) + 1, size=(12.0, 4.0), sharey=True)
    for panel, share in zip(panels, shares, strict=False):
        for n, way in enumerate(answer["way"].values):
            one = 1e6 * answer["largest"].sel(share=share, way=way)
            low, middle, high = one.quantile([0.0, 0.5, 1.0], ["drive", "draw"]).values
            panel.fill_between(answer["angle"], low, high, color=figures.CYCLE[n], alpha=0.2)
            panel.plot(answer["angle"], middle, color=figures.CYCLE[n], label=str(way))
        panel.set_title(f"{share:g} of the Red Book's deviation")
        figures.label(panel, x="angle of the disc [revolutions]")
    steps = panels[-1]
    size = 1e6 * answer["stepped"]
    for name in answer["drive"].values:
        steps.plot(answer["step"], size.sel(drive=name).mean("draw"), ".-", color="0.6")
    linear = 1e6 * answer["per_volt"].max() * answer["step"]
    steps.plot(answer["step"], linear, ":", color=figures.BLACK, label="linear loop")
    steps.set_xscale("log")
    steps.legend()
    figures.label(steps, x="step of the command [V]", title="step alone, 12 drives")
    for panel in panels:
        panel.axhline(1e6 * CAPTURE[axis], color="0.4", linewidth=0.8, linestyle="--")
        panel.set_yscale("log")
    text = rf"largest {axis} error in {milliseconds:g} ms [$\mu$m]"
    figures.label(panels[0], y=text)
    figures.legend_below(drawn, panels[0])
    return drawn
