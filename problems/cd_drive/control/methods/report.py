"""Table 5.1 in numbers, and the curves of its methods.

Table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from workbench import figures
from workbench.heavy_types import DataArray, Dataset, Figure

from .designs import FULL_ORDER

if TYPE_CHECKING:
    from ...drive.tables import Axis

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


def method_tables(answer: Dataset) -> dict[str, str]:
    return {
        "methods": _methods(answer),
        "uncertainty": _uncertainty(answer),
        "claims": _claims(answer),
    }


def _methods(answer: Dataset) -> str:
    """Certified upper bounds; "yes" where that proves the condition, "no" where it is refuted."""
    shown = ("nominal performance", "robust stability", "robust performance", "disturbance alone")
    heads = ["method", "order", "nominal stability", *shown[:3], "RP of z_p alone", "Table 5.1"]
    rows = []
    for name in answer["design"].values.tolist():
        one = answer.sel(design=name)
        stable = "yes" if float(one["pole"]) < 0 else "no"
        peaks = [_judged(one["peak"].sel(condition=condition)) for condition in shown]
        rows.append([name, str(int(one["order"])), stable, *peaks, CLAIMS[name]])
    return aligned(heads, rows)


def _uncertainty(answer: Dataset) -> str:
    """Robust performance by what a method can see of the uncertainty; the least of each starred."""
    conditions = ("robust performance", "complex scalars", "full block")
    upper = answer["peak"].sel(bound="upper")
    heads = ["method", "scalars as they are", "scalars complex", "one full block"]
    rows = []
    for name in answer["design"].values.tolist():
        cells = []
        for condition in conditions:
            value = float(upper.sel(design=name, condition=condition))
            least = value <= float(upper.sel(condition=condition).min())
            cells.append(f"{value:.3f}{' *' if least else ''}")
        rows.append([name, *cells])
    return aligned(heads, rows)


def _claims(answer: Dataset) -> str:
    """What Table 5.1 and section 5.1 say, and what was found here."""
    peak = answer["peak"].sel(bound="upper")
    names = answer["design"].values.tolist()

    def value(name: str, condition: str = "robust performance") -> float:
        return float(peak.sel(design=name, condition=condition))

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
    return aligned(["section 5.1", "found"], rows)


def _judged(bounds: DataArray) -> str:
    lower, upper = bounds.values.tolist()
    return f"{upper:.3f} {'yes' if upper < 1 else 'no' if lower >= 1 else 'open'}"


def aligned(heads: list[str], rows: list[list[str]]) -> str:
    """A Markdown table with columns of even width."""
    width = [max(len(row[i]) for row in [heads, *rows]) for i in range(len(heads))]
    lines = [heads, ["-" * size for size in width], *rows]
    return "".join(
        "| " + " | ".join(cell.ljust(size) for cell, size in zip(row, width, strict=True)) + " |\n"
        for row in lines
    )


def method_figures(axis: Axis, answer: Dataset) -> dict[str, Figure]:
    return {"mu": _mu(axis, answer), "sensitivity": _sensitivity(axis, answer)}


def _mu(axis: Axis, answer: Dataset) -> Figure:
    """Robust performance over frequency; dots are the certified peaks."""
    figure, (panel,) = figures.axes(size=(7.5, 5.2))
    low, high = answer["frequency"].values[[0, -1]]
    for name in answer["design"].values.tolist():
        dash, colour = LOOKS[name]
        one = answer.sel(design=name)
        order = int(one["order"])
        label = f"{name}, order {order}"
        panel.loglog(
            answer["frequency"], one["mu"].sel(bound="upper"), dash, color=colour, label=label
        )
        at = float(one["peak_frequency"].sel(condition="robust performance"))
        top = float(one["peak"].sel(condition="robust performance", bound="upper"))
        if low <= at <= high:
            panel.plot(at, top, "o", color=colour, markersize=4)
    panel.axhline(1.0, color="0.4", linewidth=0.8)
    panel.set_title(f"{axis}, robust performance of w_p to (z_p, z_u)")
    panel.set_ylabel("mu [1]")
    panel.set_xlabel("frequency [Hz]")
    figures.legend_below(figure, panel, 3)
    return figure


def _sensitivity(axis: Axis, answer: Dataset) -> Figure:
    figure, (panel,) = figures.axes(size=(7.5, 5.2))
    for name in answer["design"].values.tolist():
        dash, colour = LOOKS[name]
        panel.loglog(
            answer["frequency"], answer["S"].sel(design=name), dash, color=colour, label=name
        )
    panel.loglog(
        answer["frequency"], answer["permitted"], color="0.6", linewidth=3, zorder=0,
        label="1/|W_p|",
    )  # fmt: skip
    panel.set_title(f"{axis}, nominal sensitivity")
    panel.set_ylabel("|S| [1]")
    panel.set_xlabel("frequency [Hz]")
    figures.legend_below(figure, panel, 3)
    return figure
