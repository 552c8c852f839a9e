"""Figure and table of `cd/{axis}/two-controllers-switched`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from workbench import figures
from workbench.heavy_types import Dataset, Figure

from ...drive.tables import Axis


def figures_of(answer: Dataset, axis: Axis) -> dict[str, Figure]:
    """Time out of spec of each case, cause by cause."""
    figure, (panel,) = figures.axes(size=(8.0, 4.4))
    groups = [str(name) for name in answer["group"].values]
    place = np.arange(len(groups))
    for n, case in enumerate(answer["case"].values):
        own, colour = answer.sel(case=case), figures.CYCLE[n]
        low, high = (100 * own["arm_interval"].sel(end=end).values for end in ("low", "high"))
        arm = 100 * own["arm"].values
        error = np.maximum([arm - low, high - arm], 0.0)
        panel.bar(
            place + 0.27 * (n - 1), arm, 0.25, yerr=error, color=colour, capsize=2, label=str(case)
        )
    panel.set_xticks(place, groups, rotation=25, ha="right")
    panel.set_yscale("symlog", linthresh=0.1, linscale=0.4)
    panel.set_ylim(bottom=0.0)
    panel.set_ylabel("time out of spec, 95 % interval [%]")
    panel.set_title(axis)
    figures.legend_below(figure, panel)
    return {"switched": figure}


def tables_of(answer: Dataset, numbers: Mapping[str, float]) -> dict[str, str]:
    """Scores of each case, and what switching gains over it."""
    rows = [
        "| controller | in spec | lost | balloon | switched less this one, 95 % |",
        "| --- | --- | --- | --- | --- |",
    ]
    for case in answer["case"].values:
        key = f"switched_less_{case}"
        gain = (
            f"{numbers[key]:+.3f} ({numbers[f'{key}_low']:+.3f} to {numbers[f'{key}_high']:+.3f})"
            if key in numbers
            else ""
        )
        rows.append(
            f"| {case} | {numbers[f'in_spec_{case}']:.2%} | {numbers[f'lost_{case}']:.1%} "
            f"| {numbers[f'balloon_{case}']:.3f} | {gain} |"
        )
    return {"switched": "\n".join(rows)}
