"""How far the objectives of two methods lie apart, for every pair of methods."""

from __future__ import annotations

import numpy as np

from workbench import figures
from workbench.bench.comparison.layout import METHOD
from workbench.bench.comparison.numbers import disagreements
from workbench.bench.comparison.styles import GID, WIDTH
from workbench.heavy_types import Dataset, Figure

LEAST, MOST = 1e-12, 1.0
"""Ends of the colour scale: differences beyond have the colour of the end."""
DARK = 1e-6
"""Differences below are written in white, on the dark half of the scale."""


def agreement_matrix(data: Dataset) -> Figure:
    """Largest relative difference of the objectives of valid answers, for each pair of methods.

    Over all problems and repetitions that both answered at the finest accuracy level; a cross where
    there is none. The text in a cell is the difference.
    """
    from matplotlib.colors import LogNorm

    names = [str(name) for name in data[METHOD].values]
    finest = int(np.argmin(data["tolerance"].values))
    apart = disagreements(data.isel(accuracy=[finest]))
    side = 1.6 + 0.52 * len(names)
    # As wide as the figures beside it, or letters would be larger than theirs.
    figure, (panel,) = figures.axes(size=(max(side + 1.2, WIDTH), max(side, 3.4)))
    clipped = np.ma.masked_invalid(np.clip(apart, LEAST, MOST))
    shown = panel.imshow(clipped, norm=LogNorm(LEAST, MOST), cmap="cividis")
    for i, j in np.ndindex(*apart.shape):
        value = float(apart[i, j])
        text = "x" if np.isnan(value) else _short(value)
        dark = np.isfinite(value) and value < DARK
        panel.text(
            j, i, text, ha="center", va="center", fontsize=8, gid=f"{GID}{names[i]}",
            color="white" if dark else figures.BLACK,
        )  # fmt: skip
    panel.grid(False)
    panel.set_xticks(range(len(names)), names, rotation=45, ha="right", rotation_mode="anchor")
    panel.set_yticks(range(len(names)), names)
    panel.set_xlabel("method")
    panel.set_ylabel("method")
    bar = figure.colorbar(shown, ax=panel, extend="both", shrink=0.9)
    bar.set_label("largest difference [relative]")
    panel.set_title(f"objectives at {data['accuracy'].values[finest]}")
    bar.ax.set_yticks([1e-12, 1e-9, 1e-6, 1e-3, 1.0])
    bar.ax.minorticks_off()
    return figure


def _short(value: float) -> str:
    """A difference in few letters: 0, 3e-09 as 3e-9, and plain numbers from 0.01."""
    if value == 0:
        return "0"
    if value >= 0.01:
        return f"{value:.2g}"
    mantissa, exponent = f"{value:.0e}".split("e")
    return f"{mantissa}e{int(exponent)}"
