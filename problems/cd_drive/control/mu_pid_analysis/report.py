"""Figures 6.4 and 6.5 and tables of the mu-PID's analysis, beside what the thesis says."""

from __future__ import annotations

from itertools import product

from workbench import figures
from workbench.heavy_types import Axes, Dataset, Figure

from ...drive.tables import Axis

LOOKS = {
    "parametric": ("--", figures.GREEN),
    "circle": (":", figures.ORANGE),
    "stadium": ("-", figures.BLUE),
}
SET_LOOKS = {
    "circle": (":", figures.ORANGE),
    "stadium narrowest": ("-", figures.BLUE),
    "stadium third set": ("--", figures.SKY),
    "stadium for mu": ("-.", figures.GREEN),
}
RESONANCE = (20.0, 60.0)
"""Where [Hz] the first resonance of either axis is."""


def mu_figures(axis: Axis, answer: Dataset) -> dict[str, Figure]:
    return {
        "one-x": _one_x(axis, answer),
        "five-x": _five_x(axis, answer),
        "gains": _gains(axis, answer),
    }


def _one_x(axis: Axis, answer: Dataset) -> Figure:
    """Figure 6.4, and what the sets allow that the fitted weights do not."""
    figure, (fitted, sets) = figures.axes(1, 2, size=(10.0, 4.6), sharex=True, sharey=True)
    case = answer.sel(gain="own", speed=1.0)
    for form, (dash, colour) in LOOKS.items():
        curve = case["mu"].sel(channel="disturbance", form=form, bound="upper")
        fitted.loglog(answer["frequency"], curve, dash, color=colour, label=form)
        _mark_peak(fitted, case, "disturbance", form, colour)
    for name, (dash, colour) in SET_LOOKS.items():
        curve = case["set_mu"].sel(single="disturbance", set=name)
        sets.loglog(answer["frequency"], curve, dash, color=colour, label=f"{name}, no weights")
    fitted.set_title(f"{axis}, 1X, fitted models")
    sets.set_title("sets alone, no weights fitted")
    for panel in (fitted, sets):
        _limit(panel)
    fitted.set_ylabel("mu, w_p to z_p")
    lines = [line for panel in (fitted, sets) for line in panel.get_legend_handles_labels()[0]]
    figure.legend(handles=lines, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _five_x(axis: Axis, answer: Dataset) -> Figure:
    """Figure 6.5: both channels at 5X, and with the gain that makes them equally bad."""
    figure, panels = figures.axes(2, 1, size=(7.5, 7.0), sharex=True)
    case = answer.sel(gain="own", speed=5.0)
    gain = float(answer["adjusted_gain"])
    for panel, single, name in zip(
        panels, answer["single"].values, ("w_p to z_p", "w_u to z_u"), strict=True
    ):
        for form, (dash, colour) in LOOKS.items():
            curve = case["mu"].sel(channel=single, form=form, bound="upper")
            panel.loglog(answer["frequency"], curve, dash, color=colour, label=form)
            _mark_peak(panel, case, single, form, colour)
        panel.loglog(
            answer["frequency"],
            answer["adjusted_mu"].sel(single=single, bound="upper"),
            "-.",
            color=figures.BLACK,
            label=f"stadium, gain x {gain:.3g}",
        )
        panel.set_ylabel(f"mu, {name}")
        _limit(panel)
    panels[0].set_title(f"{axis}, 5X")
    panels[0].set_xlabel("")
    figures.legend_below(figure, panels[0])
    return figure


def _gains(axis: Axis, answer: Dataset) -> Figure:
    """Circles and stadiums of the three gain variants at 1X."""
    figure, panels = figures.axes(1, 2, size=(10.0, 4.4), sharex=True, sharey=True)
    case = answer["mu"].sel(speed=1.0, channel="disturbance", bound="upper")
    for panel, form in zip(panels, ("circle", "stadium"), strict=True):
        for gain in answer["gain"].values:
            curve = case.sel(form=form, gain=gain)
            panel.loglog(answer["frequency"], curve, label=f"{gain} gain")
        panel.set_title(f"{axis}, 1X, {form}s")
        _limit(panel)
    panels[0].set_ylabel("mu, w_p to z_p")
    figures.legend_below(figure, panels[0])
    return figure


def _mark_peak(panel: Axes, case: Dataset, channel: str, form: str, colour: str) -> None:
    at = {"channel": channel, "form": form, "condition": "robust performance"}
    top, where = case["peak"].sel(at).sel(bound="upper"), case["peak_frequency"].sel(at)
    low, high = case["frequency"].values[[0, -1]]
    if low <= float(where) <= high:
        panel.plot(float(where), float(top), "o", color=colour, markersize=4)


def _limit(panel: Axes) -> None:
    panel.axhline(1.0, color="0.4", linewidth=0.8)
    panel.set_xlabel("frequency [Hz]")


def conditions_table(answer: Dataset) -> str:
    """Certified peaks [lower, upper] and their frequencies, a line for every loop."""
    conditions = answer["condition"].values
    lines = [
        f"| gain | speed | channel | form | {' | '.join(conditions)} | at [Hz] |",
        "| --- | ---: | --- | --- |" + " ---: |" * (len(conditions) + 1),
    ]
    cases = product(*(answer[name].values for name in ("gain", "speed", "channel", "form")))
    for gain, speed, channel, form in cases:
        if form == "parametric" and gain != "own":
            continue
        at = {"gain": gain, "speed": speed, "channel": channel, "form": form}
        peaks = [
            "{:.4f} to {:.4f}".format(*answer["peak"].sel(at).sel(condition=name).values)
            for name in conditions
        ]
        where = float(answer["peak_frequency"].sel(at).sel(condition="robust performance"))
        shown = "all" if form == "parametric" else gain
        lines.append(
            f"| {shown} | {speed:g}X | {channel} | {form} | {' | '.join(peaks)} | {where:.2f} |"
        )
    return "\n".join(lines) + "\n"


def sets_table(answer: Dataset) -> str:
    """Largest mu over the frequencies of sets without weights, at 1X, and in the resonance."""
    lines = [
        "| gain | sets | largest mu | at [Hz] | in the resonance |",
        "| --- | --- | ---: | ---: | ---: |",
    ]
    mu = answer["set_mu"].sel(speed=1.0, single="disturbance")
    for gain, name in product(answer["gain"].values, answer["set"].values):
        curve = mu.sel(gain=gain, set=name)
        near = float(curve.sel(frequency=slice(*RESONANCE)).max())
        where = float(curve.idxmax("frequency"))
        lines.append(f"| {gain} | {name} | {float(curve.max()):.4f} | {where:.2f} | {near:.4f} |")
    return "\n".join(lines) + "\n"


def claims_table(answer: Dataset) -> str:
    """What section 6.3 says of the focus loop, and what was found for this axis."""
    own = answer.sel(gain="own")
    sets = own["set_mu"].sel(speed=1.0, single="disturbance")

    def peak(speed: float, channel: str, form: str) -> str:
        at = {"speed": speed, "channel": channel, "form": form, "condition": "robust performance"}
        upper, where = own["peak"].sel(at).sel(bound="upper"), own["peak_frequency"].sel(at)
        return f"{float(upper):.3f} at {float(where):.1f} Hz"

    def of_set(name: str) -> str:
        curve = sets.sel(set=name)
        return f"{float(curve.max()):.3f} at {float(curve.idxmax('frequency')):.1f} Hz"

    control = "; ".join(f"{form} {peak(1.0, 'control', form)}" for form in LOOKS)
    lines = [
        "| section 6.3, focus | mu |",
        "| --- | --- |",
        f"| 1X: parametric below 1 | {peak(1.0, 'disturbance', 'parametric')} |",
        f"| 1X: circles above 1 near 30 Hz | {peak(1.0, 'disturbance', 'circle')} |",
        f"| the same, sets without weights | {of_set('circle')} |",
        f"| 1X: stadiums below 1 | {peak(1.0, 'disturbance', 'stadium')} |",
        f"| the same, narrowest sets without weights | {of_set('stadium narrowest')} |",
        f"| ... third sets | {of_set('stadium third set')} |",
        f"| ... oriented for mu | {of_set('stadium for mu')} |",
        f"| 1X: control channel below 1 | {control} |",
        f"| 5X: disturbance reaches 20 | {peak(5.0, 'disturbance', 'stadium')} |",
        f"| 5X: control channel below 1 | {peak(5.0, 'control', 'stadium')} |",
    ]
    return "\n".join(lines) + "\n"
