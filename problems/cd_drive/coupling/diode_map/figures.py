"""Figure of the errors that every estimate leaves in defects."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench.types import DataArray, Figure


def left_by_kind(rms: DataArray) -> Figure:
    """Rms error [um] of every estimate, by kind of defect, axis and refraction."""
    drawn, panels = figures.axes(2, 2, size=(10.0, 6.0), sharex=True, sharey="row")
    kinds, names = rms["kind"].values, rms["estimate"].values
    place = np.arange(len(kinds))
    cells = [(axis, one) for axis in rms["axis"].values for one in rms["refraction"].values]
    for panel, (axis, one) in zip(panels, cells, strict=True):
        for n, name in enumerate(names):
            height = rms.sel(axis=axis, refraction=one, estimate=name)
            beside = place + 0.2 * (n - 1.5)
            panel.bar(beside, height, 0.18, color=figures.CYCLE[n], label=name)
        panel.set_title(f"{axis}, displacements {one}")
        panel.set_xticks(place, list(kinds))
    for panel in panels[::2]:
        figures.label(panel, y=r"rms error in defects [$\mu$m]")
    figures.legend_below(drawn, panels[2], columns=len(names))
    return drawn
