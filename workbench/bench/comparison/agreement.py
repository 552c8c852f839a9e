"""Figure of the difference between the objectives of every pair of methods."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench._core.heavy_types import Dataset, Figure
from workbench.bench.comparison.layout import METHOD
from workbench.bench.comparison.numbers import disagreements
from workbench.bench.comparison.styles import GID, WIDTH

LEAST, MOST = 1e-12, 1.0
"""Ends of the colour scale; differences outside it get the colour of the nearer end."""
MOST_LETTERS = 50
"""Most letters that fit side by side below the columns."""
DARK = 1e-6
"""Differences below this are written in white, on the dark half of the scale."""


def agreement_matrix(data: Dataset) -> Figure:
    """Largest relative difference between the objectives of valid answers, by pairs of methods.

    It is taken over all problems and repetitions that both methods answered at the finest accuracy
    level; "none" if there are none. The text in a cell is the difference.
    """
    from matplotlib.colors import LogNorm

    names = [str(name) for name in data[METHOD].values]
    finest = int(np.argmin(data["tolerance"].values))
    apart = disagreements(data.isel(accuracy=[finest]))
    figure, (panel,) = figures.axes(1, 1, size=(WIDTH, max(1.2 + 0.4 * len(names), 2.8)))
    clipped = np.ma.masked_invalid(np.clip(apart, LEAST, MOST))
    shown = panel.imshow(clipped, norm=LogNorm(LEAST, MOST), cmap="cividis", aspect="auto")
    for i, j in np.ndindex(*apart.shape):
        value = float(apart[i, j])
        text = "none" if np.isnan(value) else _short(value)
        dark = np.isfinite(value) and value < DARK
        panel.text(
            j, i, text, ha="center", va="center", fontsize=8, gid=f"{GID}{names[i]}",
            color="white" if dark else figures.BLACK,
        )  # fmt: skip
    panel.grid(False)
    panel.set_xticks(range(len(names)), names, **_column_label_keywords(names))
    panel.set_yticks(range(len(names)), names)
    panel.set_xlabel("method")
    panel.set_ylabel("method")
    bar = figure.colorbar(shown, ax=panel, extend="both")
    bar.set_label("largest difference [relative]")
    panel.set_title(f"objectives of valid answers, {data['accuracy'].values[finest]} accuracy")
    bar.ax.set_yticks([1e-12, 1e-9, 1e-6, 1e-3, 1.0])
    bar.ax.minorticks_off()
    return figure


def _column_label_keywords(names: list[str]) -> dict[str, Any]:
    """Keywords for labels below the columns; they are rotated if they would overlap."""
    if max(map(len, names)) * len(names) <= MOST_LETTERS:
        return {}
    return {"rotation": 45, "ha": "right", "rotation_mode": "anchor"}


def _short(value: float) -> str:
    """A difference in few letters: 0, 3e-9 for 3e-09, and plain numbers from 0.01 on."""
    if value == 0:
        return "0"
    if value >= 0.01:
        return f"{value:.2g}"
    mantissa, exponent = f"{value:.0e}".split("e")
    return f"{mantissa}e{int(exponent)}"
