"""Table 5.1 in numbers, and the curves of its methods.

Table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from typing import Any

from workbench import figures
from workbench.study import Rows
from workbench.types import DataArray, Dataset, Figure

from ...drive.tables import Axis
from .designs import FULL_ORDER

CLAIMS = {
    "reference": "not in the table",
    "LQG": "not in the table: no model uncertainty (section 5.1)",
    "mixed sensitivity": "NP, (RP); unstructured",
    "loop shaping": "NP, (RP); unstructured",
    "full block": "NP, (RP); unstructured",
    "D-K": "NP, RP; unstructured, complex, repeated",
    "(mu,D)-K": "NP, RP; unstructured, complex, real, repeated",
    "fixed order": "not in the table",
}
"""Check marks of Table 5.1; in brackets: by a rather conservative approach."""
LOOKS = {
    "reference": ("-", figures.BLACK),
    "LQG": (":", figures.AMBER),
    "mixed sensitivity": ("--", figures.ORANGE),
    "loop shaping": ("-.", figures.GREEN),
    "full block": (":", figures.PURPLE),
    "D-K": ("--", figures.SKY),
    "(mu,D)-K": ("-", figures.BLUE),
    "fixed order": ("--", figures.BLACK),
}


def methods_table(answer: Dataset) -> Rows:
    """Certified upper bounds; "yes" if a bound proves the condition, "no" if the condition is
    refuted.
    """
    shown = ("nominal performance", "robust stability", "robust performance", "disturbance alone")
    heads = ["method", "order", "nominal stability", *shown[:3], "RP of z_p alone", "Table 5.1"]
    rows = []
    for name in answer["design"].values.tolist():
        one = answer.sel(design=name)
        stable = "yes" if float(one["pole"]) < 0 else "no"
        peaks = [_judged(one["peak"].sel(condition=condition)) for condition in shown]
        rows.append([name, str(int(one["order"])), stable, *peaks, CLAIMS[name]])
    return heads, rows


def uncertainty_table(peak: DataArray) -> Rows:
    """Robust performance for each structure that a method can use; the least of each is starred."""
    conditions = ("robust performance", "complex scalars", "full block")
    upper = peak.sel(bound="upper")
    heads = ["method", "scalars as they are", "scalars complex", "one full block"]
    rows = []
    for name in upper["design"].values.tolist():
        cells = []
        for condition in conditions:
            value = float(upper.sel(design=name, condition=condition))
            least = value <= float(upper.sel(condition=condition).min())
            cells.append(f"{value:.3f}{' *' if least else ''}")
        rows.append([name, *cells])
    return heads, rows


def claims_table(peak: DataArray) -> Rows:
    """Statements of Table 5.1 and section 5.1, with the numbers found."""
    upper = peak.sel(bound="upper")
    names = upper["design"].values.tolist()

    def value(name: str, condition: str = "robust performance") -> float:
        return float(upper.sel(design=name, condition=condition))

    def least(condition: str, among: list[str]) -> tuple[str, float]:
        best = min(among, key=lambda name: value(name, condition))
        return best, value(best, condition)

    def found(name: str, condition: str) -> str:
        others = [each for each in FULL_ORDER if each in names and each != name]
        best, size = least(condition, others)
        mine = value(name, condition)
        verdict = "holds" if mine <= size else "does not hold"
        return f"{verdict}: {mine:.3f}, least of the others {size:.3f} ({best})"

    standard = [n for n in ("mixed sensitivity", "loop shaping", "full block") if n in names]
    performing = [f"{name} {value(name, 'nominal performance'):.3f}" for name in standard]
    rows = [["standard methods give nominal performance, below 1", "; ".join(performing)]]
    for name, condition, words in (
        ("full block", "full block", "standard H-infinity: the least peak against a full block"),
        ("D-K", "complex scalars", "D-K: the least peak with complex scalars"),
        ("(mu,D)-K", "robust performance", "(mu,D)-K: the least peak of mixed mu"),
    ):
        if name in names:
            rows.append([f"{words} at full order", found(name, condition)])
    if {"D-K", "(mu,D)-K"} <= set(names):
        cost = f"D-K {value('D-K'):.3f}, (mu,D)-K {value('(mu,D)-K'):.3f}"
        rows.append(["real scalars: (mu,D)-K better than D-K, by mixed mu", cost])
    best, size = least("robust performance", names)
    rows.append(["least peak of mixed mu of all", f"{size:.3f} ({best})"])
    return ["section 5.1", "found"], rows


def _judged(bounds: DataArray) -> str:
    lower, upper = bounds.values.tolist()
    return f"{upper:.3f} {'yes' if upper < 1 else 'no' if lower >= 1 else 'open'}"


def mu_figure(axis: Axis, answer: Dataset) -> Figure:
    """Robust performance over frequency; dots mark the certified peaks."""
    figure, (panel,) = figures.axes(1, 1, size=(7.5, 5.2))
    low, high = answer["frequency"].values[[0, -1]]
    for name in answer["design"].values.tolist():
        dash, colour = LOOKS[name]
        one = answer.sel(design=name)
        label, upper = f"{name}, order {int(one['order'])}", one["mu"].sel(bound="upper")
        panel.loglog(answer["frequency"], upper, dash, color=colour, label=label)
        at = float(one["peak_frequency"].sel(condition="robust performance"))
        top = float(one["peak"].sel(condition="robust performance", bound="upper"))
        if low <= at <= high:
            panel.plot(at, top, "o", color=colour, markersize=4)
    panel.axhline(1.0, color="0.4", linewidth=0.8)
    title = f"{axis}, robust performance of $w_p$ to $(z_p, z_u)$"
    figures.label(panel, x="frequency [Hz]", y="$\\mu$ [1]", title=title)
    figures.legend_below(figure, panel, columns=3)
    return figure


def sensitivity_figure(axis: Axis, answer: Dataset) -> Figure:
    figure, (panel,) = figures.axes(1, 1, size=(7.5, 5.2))
    for name in answer["design"].values.tolist():
        dash, colour = LOOKS[name]
        S = answer["S"].sel(design=name)
        panel.loglog(answer["frequency"], S, dash, color=colour, label=name)
    limit: dict[str, Any] = {"color": "0.6", "linewidth": 3, "zorder": 0}
    panel.loglog(answer["frequency"], answer["permitted"], **limit, label="$1/|W_p|$")
    figures.label(panel, x="frequency [Hz]", y="$|S|$ [1]", title=f"{axis}, nominal sensitivity")
    figures.legend_below(figure, panel, columns=3)
    return figure
