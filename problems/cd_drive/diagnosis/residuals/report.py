"""Figures and tables of `cd/{axis}/residuals`."""

from __future__ import annotations

from workbench import figures
from workbench.heavy_types import Dataset, Figure

NAMES = {
    "sum": "sum signal",
    "quality": "quality signal",
    "error": "error, high-passed",
    "cusum": "CUSUM of the sum",
    "glr": "GLR of the sum",
}
STYLES = {"sum": "-", "quality": "--", "error": "-.", "cusum": "-", "glr": ":"}
MARKERS = {"sum": "o", "quality": "s", "error": "^", "cusum": "D", "glr": "v"}
SHOWN = 0.1
"""Depth of the defects whose curves are shown over length and noise."""


def figures_of(answer: Dataset) -> dict[str, Figure]:
    """ROC curves, and areas and delays over depth."""
    return {"roc": curves(answer), "area": areas(answer)}


def curves(answer: Dataset) -> Figure:
    """A panel for each length (column) and noise (row), defects of one depth."""
    lengths, noises = answer["length"].values, answer["noise"].values
    figure, panels = figures.axes(
        len(noises), len(lengths), size=(9.0, 8.4), sharex=True, sharey=True
    )
    for row, noise in enumerate(noises):
        for column, length in enumerate(lengths):
            panel = panels[row * len(lengths) + column]
            one = answer["detection"].sel(depth=SHOWN, length=length, noise=noise)
            for name, text in NAMES.items():
                curve = one.sel(statistic=name).values[1:]
                panel.plot(answer["rate"].values[1:], curve, STYLES[name], label=text)
            panel.set_xscale("log")
            panel.set_title(f"{1e3 * length:g} mm, noise {1e6 * noise:g} um")
            if column == 0:
                panel.set_ylabel("detection rate [1]")
            if row == len(noises) - 1:
                panel.set_xlabel("false alarms per window [1]")
    panels[0].set_ylim(-0.02, 1.02)
    figure.suptitle(f"defects that take {SHOWN:.0%} of the light")
    figures.legend_below(figure, panels[0], columns=5)
    return figure


def areas(answer: Dataset) -> Figure:
    """Area under the curve with two standard errors, and delay, over depth at the usual noise."""
    lengths = answer["length"].values
    usual = answer.isel(noise=len(answer["noise"]) // 2)
    figure, panels = figures.axes(2, len(lengths), size=(9.5, 6.4), sharex=True, sharey="row")
    depth = 100 * answer["depth"].values
    for column, length in enumerate(lengths):
        above, below = panels[column], panels[len(lengths) + column]
        for number, (name, text) in enumerate(NAMES.items()):
            one = usual.sel(length=length, statistic=name)
            beside = depth * 1.03 ** (number - 2)  # so that the bars can be told apart
            above.errorbar(
                beside,
                one["area"].values,
                2 * one["deviation"].values,
                fmt=STYLES[name],
                marker=MARKERS[name],
                markersize=4.0,
                capsize=2.0,
                label=text,
            )
            delay = one["delay"].where(one["missed"] <= 0.5)
            below.plot(
                beside, 1e3 * delay.values, STYLES[name], marker=MARKERS[name], markersize=4.0
            )
        above.set_title(f"{1e3 * length:g} mm")
        below.set_xlabel("light taken [%]")
        below.set_xscale("log")
        below.set_xticks(depth, [f"{one:g}" for one in depth])
        below.minorticks_off()
        below.set_yscale("log")
    panels[0].set_ylabel("area under the ROC curve [1]")
    panels[len(lengths)].set_ylabel("mean delay, where half are found [ms]")
    figures.legend_below(figure, panels[0], columns=5)
    return figure


def tables_of(answer: Dataset) -> dict[str, str]:
    """Areas of all conditions; confusion of the faults and how often each residual fired."""
    names = list(NAMES)
    lines = [
        "| light taken | length [mm] | noise [um] | " + " | ".join(NAMES[n] for n in names) + " |",
        "| ---: | ---: | ---: |" + " ---: |" * len(names),
    ]
    for depth in answer["depth"].values:
        for length in answer["length"].values:
            for noise in answer["noise"].values:
                one = answer["area"].sel(depth=depth, length=length, noise=noise)
                cells = " | ".join(f"{float(one.sel(statistic=name)):.3f}" for name in names)
                lines.append(f"| {depth:.0%} | {1e3 * length:g} | {1e6 * noise:.3g} | {cells} |")
    found = [str(name) for name in answer["isolated_as"].values]
    rows = [f"| fault | {' | '.join(found)} |", "| --- |" + " ---: |" * len(found)]
    residuals = [str(name) for name in answer["residual"].values]
    fired = [
        f"| share that fired | {' | '.join(residuals)} |",
        "| --- |" + " ---: |" * len(residuals),
    ]
    for fault in answer["fault"].values:
        counts = answer["confusion"].sel(fault=fault).values
        rows.append(f"| {fault} | {' | '.join(str(int(count)) for count in counts)} |")
        share = answer["fired"].sel(fault=fault).values
        fired.append(f"| {fault} | {' | '.join(f'{float(one):.2f}' for one in share)} |")
    return {"areas": "\n".join(lines) + "\n", "isolation": "\n".join([*rows, "", *fired]) + "\n"}
