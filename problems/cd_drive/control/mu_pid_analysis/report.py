"""Figures 6.4 and 6.5 and tables of the mu-PID's analysis, compared with the thesis."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

from workbench import figures
from workbench.study import Rows
from workbench.types import Axes, DataArray, Dataset, Figure

from ...drive.tables import Axis

LOOKS: dict[str, tuple[Any, str]] = {
    "parametric": ("--", figures.GREEN),
    "circle": (":", figures.ORANGE),
    "stadium": ("-", figures.BLUE),
}
SET_LOOKS: dict[str, tuple[Any, str]] = {
    "circle": (":", figures.ORANGE),
    "stadium narrowest": ("-", figures.BLUE),
    "stadium third set": ("--", figures.SKY),
    "stadium for mu": ("-.", figures.GREEN),
    "stadium of smallest area": ((0, (5, 1, 1, 1, 1, 1)), figures.PURPLE),
}
RESONANCE_BAND = (20.0, 60.0)
"""Frequencies [Hz] around the first resonance of either axis."""


def mu_figures(axis: Axis, answer: Dataset) -> dict[str, Figure]:
    return {
        "one-x": _one_x(axis, answer),
        "five-x": _five_x(axis, answer),
        "gains": _gains(axis, answer),
    }


def _one_x(axis: Axis, answer: Dataset) -> Figure:
    """Figure 6.4, and mu of the sets themselves, which is less than with the fitted weights."""
    figure, (fitted, sets) = figures.axes(1, 2, size=(10.0, 4.6), sharex=True, sharey=True)
    case = answer.sel(gain="own", speed=1.0)
    for form, (dash, colour) in LOOKS.items():
        curve = case["mu"].sel(channel="disturbance", form=form, bound="upper")
        fitted.loglog(answer["frequency"], curve, dash, color=colour, label=form)
        _mark_peak(fitted, case, "disturbance", form, colour)
    for name, (dash, colour) in SET_LOOKS.items():
        curve = case["set_mu"].sel(single="disturbance", set=name)
        sets.loglog(
            answer["frequency"], curve, linestyle=dash, color=colour, label=f"{name}, no weights"
        )
    _limit(fitted, "$\\mu$, $w_p$ to $z_p$", f"{axis}, 1X, fitted models")
    _limit(sets, title="sets alone, no weights fitted")
    lines = [line for panel in (fitted, sets) for line in panel.get_legend_handles_labels()[0]]
    figure.legend(handles=lines, loc="outside lower center", ncols=4, frameon=False)
    return figures.with_figure_numbers(figure, "6.4")


def _five_x(axis: Axis, answer: Dataset) -> Figure:
    """Figure 6.5: both channels at 5X, and with the gain that makes them equally bad."""
    figure, panels = figures.axes(2, 1, size=(7.5, 7.0), sharex=True)
    case = answer.sel(gain="own", speed=5.0)
    gain = float(answer["adjusted_gain"])
    signals = ("$w_p$ to $z_p$", "$w_u$ to $z_u$")
    for panel, single, name in zip(panels, answer["single"].values, signals, strict=True):
        for form, (dash, colour) in LOOKS.items():
            curve = case["mu"].sel(channel=single, form=form, bound="upper")
            panel.loglog(answer["frequency"], curve, dash, color=colour, label=form)
            _mark_peak(panel, case, single, form, colour)
        curve = answer["adjusted_mu"].sel(single=single, bound="upper")
        label = f"stadium, gain x {gain:.3g}"
        panel.loglog(answer["frequency"], curve, "-.", color=figures.BLACK, label=label)
        _limit(panel, f"$\\mu$, {name}")
    panels[0].set(title=f"{axis}, 5X", xlabel="")
    figures.legend_below(figure, panels[0])
    return figures.with_figure_numbers(figure, "6.5")


def _gains(axis: Axis, answer: Dataset) -> Figure:
    """Circles and stadiums of the three gain variants at 1X."""
    figure, panels = figures.axes(1, 2, size=(10.0, 4.4), sharex=True, sharey=True)
    case = answer["mu"].sel(speed=1.0, channel="disturbance", bound="upper")
    for panel, form in zip(panels, ("circle", "stadium"), strict=True):
        for gain in answer["gain"].values:
            curve = case.sel(form=form, gain=gain)
            panel.loglog(answer["frequency"], curve, label=f"{gain} gain")
        _limit(panel, title=f"{axis}, 1X, {form}s")
    figures.label(panels[0], y="$\\mu$, $w_p$ to $z_p$")
    figures.legend_below(figure, panels[0])
    return figure


def _mark_peak(panel: Axes, case: Dataset, channel: str, form: str, colour: str) -> None:
    at = {"channel": channel, "form": form, "condition": "robust performance"}
    top, where = case["peak"].sel(at).sel(bound="upper"), case["peak_frequency"].sel(at)
    low, high = case["frequency"].values[[0, -1]]
    if low <= float(where) <= high:
        panel.plot(float(where), float(top), "o", color=colour, markersize=4)


def _limit(panel: Axes, y: str = "", title: str = "") -> None:
    panel.axhline(1.0, color="0.4", linewidth=0.8)
    figures.label(panel, x="frequency [Hz]", y=y, title=title)


def conditions_table(answer: Dataset) -> Rows:
    """Certified peaks [lower, upper] and their frequencies, one line per loop."""
    conditions = answer["condition"].values
    rows = []
    cases = product(*(answer[name].values for name in ("gain", "speed", "channel", "form")))
    for gain, speed, channel, form in cases:
        if form == "parametric" and gain != "own":
            continue
        one = answer.sel(gain=gain, speed=speed, channel=channel, form=form)
        peaks = [
            "{:.4f} to {:.4f}".format(*one["peak"].sel(condition=name).values)
            for name in conditions
        ]
        where = float(one["peak_frequency"].sel(condition="robust performance"))
        shown = "all" if form == "parametric" else gain
        rows.append([shown, f"{speed:g}X", channel, form, *peaks, f"{where:.2f}"])
    return ["gain", "speed", "channel", "form", *conditions, "at [Hz]"], rows


def sets_table(set_mu: DataArray) -> Rows:
    """Largest mu over the frequencies for sets without fitted weights, at 1X, and within the
    resonance.
    """
    rows = []
    for gain, name in product(set_mu["gain"].values, set_mu["set"].values):
        curve = set_mu.sel(speed=1.0, single="disturbance", gain=gain, set=name)
        near = float(curve.sel(frequency=slice(*RESONANCE_BAND)).max())
        where = float(curve.idxmax("frequency"))
        rows.append([gain, name, f"{float(curve.max()):.4f}", f"{where:.2f}", f"{near:.4f}"])
    return ["gain", "sets", "largest mu", "at [Hz]", "in the resonance"], rows


def claims_table(answer: Dataset) -> Rows:
    """Statements of section 6.3 about the focus loop, with this axis' numbers and a verdict."""
    own = answer.sel(gain="own")
    sets = own["set_mu"].sel(speed=1.0, single="disturbance")

    def peak(speed: float, channel: str, form: str) -> tuple[float, float]:
        one = own.sel(speed=speed, channel=channel, form=form, condition="robust performance")
        return float(one["peak"].sel(bound="upper")), float(one["peak_frequency"])

    def set_peak(name: str) -> tuple[float, float]:
        curve = sets.sel(set=name)
        return float(curve.max()), float(curve.idxmax("frequency"))

    def below(statement: str, *found: tuple[str, tuple[float, float]]) -> list[str]:
        return _claim(statement, found, all(mu < 1.0 for _, (mu, _) in found))

    circle = peak(1.0, "disturbance", "circle")
    reaches = peak(5.0, "disturbance", "stadium")
    rows = [
        below("1X: parametric below 1", ("", peak(1.0, "disturbance", "parametric"))),
        _claim(
            "1X: circles above 1 near 30 Hz", [("", circle)], circle[0] > 1.0 and _near(circle[1])
        ),
        _claim(
            "the same, sets without weights", [("", set_peak("circle"))], set_peak("circle")[0] > 1
        ),
        below("1X: stadiums below 1", ("", peak(1.0, "disturbance", "stadium"))),
        below("the same, narrowest sets without weights", ("", set_peak("stadium narrowest"))),
        below("... third sets", ("", set_peak("stadium third set"))),
        below("... oriented for mu", ("", set_peak("stadium for mu"))),
        below("... of the smallest area", ("", set_peak("stadium of smallest area"))),
        below(
            "1X: control channel below 1",
            *((f"{form} ", peak(1.0, "control", form)) for form in LOOKS),
        ),
        _claim("5X: disturbance reaches 20", [("", reaches)], abs(reaches[0] / 20.0 - 1.0) < 0.25),
        below("5X: control channel below 1", ("", peak(5.0, "control", "stadium"))),
    ]
    return ["section 6.3, focus", "mu", "verdict"], rows


def _claim(
    statement: str, found: Sequence[tuple[str, tuple[float, float]]], holds: bool
) -> list[str]:
    """Cells of a statement: its text, each mu with its frequency, and whether they agree."""
    told = "; ".join(f"{name}{mu:.3f} at {where:.1f} Hz" for name, (mu, where) in found)
    return [statement, told, "holds" if holds else "contradicted"]


def _near(frequency: float) -> bool:
    """Whether a frequency [Hz] is near the first resonance."""
    return RESONANCE_BAND[0] <= frequency <= RESONANCE_BAND[1]
