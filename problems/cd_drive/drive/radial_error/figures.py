"""Figures of the four methods that sense a track."""

from __future__ import annotations

from workbench import figures
from workbench.types import Dataset, Figure


def over_track(answer: Dataset) -> Figure:
    """Errors over a pitch for several lengths of pits, in tracks shifted by a quarter of their
    period.
    """
    drawn, panels = figures.axes(2, 2, size=(9.0, 6.4), sharex=True)
    place = 1e6 * answer["place"]
    for panel, name in zip(panels, answer["scheme"].values, strict=True):
        for bits in answer["bits"].values:
            one = answer["error"].sel(scheme=name, width=0.5e-6, bits=bits, stagger=0.25)
            panel.plot(place, one, label=f"{bits}T")
        unit = "phase [rad]" if name == "DPD" else "normalised error"
        figures.label(panel, y=unit, title=str(name))
    for panel in panels[2:]:
        panel.set_xlabel(r"distance from the track [$\mu$m]")
    figures.legend_below(drawn, panels[0], columns=5)
    drawn.suptitle("Four methods to sense the track (figure 2.9: twin spots)", fontsize=11)
    return drawn


def against_depth(answer: Dataset, printed: float, with_offset: tuple[str, ...]) -> Figure:
    """Strength of every method, and its false error from displaced light, over the depth of the
    pits.
    """
    drawn, (strength, offset) = figures.axes(1, 2, size=(9.0, 4.2), sharex=True)
    looks = dict(zip(answer["scheme"].values.tolist(), figures.CYCLE, strict=False))
    styles = {"DPD": "--"}
    for name, colour in looks.items():
        look = {"color": colour, "linestyle": styles.get(name, "-"), "label": name}
        strength.plot(answer["depth"], answer["strength"].sel(scheme=name), **look)
        if name in with_offset:
            false = 1e6 * abs(answer["offset"].sel(scheme=name))
            offset.plot(answer["depth"], false.where(false < 0.8), **look)
    for panel in (strength, offset):
        panel.axvline(printed, color="0.4", linestyle=":", linewidth=1.0)
    at = "depth of the pits [wavelengths in the disc]"
    figures.label(strength, x=at, y="strength over a mirror's light", title="before normalising")
    title = "light lands 10 % beside the middle"
    figures.label(offset, x=at, y=r"false error [$\mu$m]", title=title)
    figures.legend_below(drawn, strength)
    return drawn
