"""Figures of covers: sets in the Nyquist plane, the nominal, and the weights over frequency."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from workbench import figures
from workbench._core.heavy_types import Axes, Figure
from workbench.geometry.figures import plane
from workbench.uncertainty.covers.steps import CoverSteps
from workbench.uncertainty.covers.weights import unwrapped
from workbench.uncertainty.responses.plants import Responses


def cover_figures(
    responses: Responses, answer: CoverSteps, windows: Mapping[str, tuple[float, float]]
) -> dict[str, Figure]:
    """Figures of the fitted sets (all, and in each window), of the nominal and of the weights."""
    points, sets = responses.labelled_points(), answer.model.shapes(responses.omega)
    drawn = {"plane": plane(points, sets, "fitted sets")}
    for caption, (low, high) in windows.items():
        chosen = np.flatnonzero((responses.frequency_hz >= low) & (responses.frequency_hz <= high))
        if chosen.size:
            name = "plane-" + "-".join(caption.lower().split())
            drawn[name] = plane(points, sets, f"fitted sets, {caption}", chosen)
    drawn["nominal"] = nominal_figure(responses, answer)
    drawn["complex-weight"] = complex_weight_figure(responses, answer)
    if answer.model.W_r is not None:
        drawn["real-weight"] = real_weight_figure(responses, answer)
    return drawn


def nominal_figure(responses: Responses, answer: CoverSteps) -> Figure:
    """Bode plot of the nominal among the plants and the centres of the first set."""
    figure, (top, bottom) = figures.axes(2, 1, size=(7.0, 6.0), sharex=True)
    fit = answer.model.nominal.response(responses.axis)
    values = np.where(responses.present, responses.values, np.nan)
    turn = figures.phase(fit)
    for axes, of in ((top, np.abs), (bottom, lambda z: turn + np.angle(z / fit, deg=True))):
        for k, plant in enumerate(values.T[:100]):
            label = "plants" if k == 0 else None
            axes.plot(responses.frequency_hz, of(plant), color="0.7", linewidth=0.6, label=label)
        centres = of(answer.first.center)
        axes.plot(
            responses.frequency_hz,
            centres,
            color=figures.ORANGE,
            ls=":",
            label="centres, first set",
        )
        axes.plot(responses.frequency_hz, of(fit), color=figures.BLUE, label="nominal")
    figures.label(top, y=f"magnitude [{responses.unit}]", log="y")
    figures.label(bottom, y="phase [deg]")
    _finish(figure, top, bottom, responses)
    return figure


def complex_weight_figure(responses: Responses, answer: CoverSteps) -> Figure:
    """Radii of the sets, calculated and fitted (figures 5.12 and 5.13 of the thesis)."""
    figure, (axes,) = figures.axes(1, 1)
    axes.plot(
        responses.frequency_hz, answer.second.radius, ":", color=figures.BLACK, label="second set"
    )
    if answer.model.W_r is not None:
        axes.plot(
            responses.frequency_hz,
            answer.third.radius,
            ":",
            color=figures.ORANGE,
            label="third set",
        )
    fit = np.abs(answer.model.W_c.response(responses.axis))
    label = f"$|W_c|$, order {answer.model.W_c.order}"
    axes.plot(responses.frequency_hz, fit, color=figures.BLUE, label=label)
    figures.label(axes, y=f"radius [{_unit(responses, answer)}]", log="y")
    _finish(figure, axes, axes, responses)
    return figure


def real_weight_figure(responses: Responses, answer: CoverSteps) -> Figure:
    """Half-length and orientation, calculated and fitted (figures 5.14 and 5.15)."""
    figure, (top, bottom) = figures.axes(2, 1, size=(7.0, 6.0), sharex=True)
    fit = answer.model.W_r.response(responses.axis)
    label = f"$W_r$, order {answer.model.W_r.order}"
    for name, sets, colour in (
        ("second set", answer.second, figures.BLACK),
        ("third set", answer.third, figures.ORANGE),
    ):
        end = unwrapped(sets.half_length * np.exp(1j * sets.angle))
        # a segment has two opposite ends; draw the one nearer to the fit
        end = np.where((end * fit.conj()).real < 0, -end, end)
        turn = figures.phase(fit) + np.angle(end / fit, deg=True)
        top.plot(responses.frequency_hz, np.abs(end), ":", color=colour, label=name)
        bottom.plot(responses.frequency_hz, turn, ":", color=colour)
    top.plot(responses.frequency_hz, np.abs(fit), color=figures.BLUE, label=label)
    bottom.plot(responses.frequency_hz, figures.phase(fit), color=figures.BLUE)
    figures.label(top, y=f"half-length [{_unit(responses, answer)}]", log="y")
    figures.label(bottom, y="orientation [deg]")
    _finish(figure, top, bottom, responses)
    return figure


def _finish(figure: Figure, source: Axes, bottom: Axes, responses: Responses) -> None:
    """Set the frequency axis, and put the legend of ``source`` below the figure."""
    wide = responses.frequency_hz[-1] > 20 * responses.frequency_hz[0]
    figures.label(bottom, x="frequency [Hz]", log="x" if wide else "")
    figures.legend_below(figure, source)


def _unit(responses: Responses, answer: CoverSteps) -> str:
    """Unit of the deviations from the nominal."""
    return "1" if answer.model.form == "multiplicative" else responses.unit
