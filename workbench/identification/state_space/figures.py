"""Figures of identified state-space models, drawn from their dataset."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset, Figure
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.state_space.validation import CORRELATION_BOUND

BAND_POINTS = 300
"""Approximate number of frequencies at which the band of a response is computed."""
BAND = 1.959964
"""Half-width of a 95 % interval of a normal distribution [standard deviations]."""
LEAST_BAND = 1e-2
"""Lower end, as a fraction of the magnitude, of a band that would reach 0, so that its end is
visible.
"""


def held_out_figure(data: Dataset, title: str, units: Sequence[str]) -> Figure:
    """Measured and modelled outputs on the held-out samples, and their differences."""
    outputs = data["output"].values
    figure, panels = figures.axes(
        2 * len(outputs), 1, size=(8.0, 2.1 * 2 * len(outputs)), sharex=True
    )
    scored = data.isel(time=slice(int(data.attrs["washout"]), None))
    for i, output in enumerate(outputs):
        signal, error = panels[2 * i], panels[2 * i + 1]
        one = data.sel(output=output)
        signal.plot(one["time"], one["measured"], color=figures.BLACK, lw=0.9, label="measured")
        signal.plot(
            one["time"], one["free_run"], color=figures.ORANGE, lw=0.9, label="simulator, free run"
        )
        signal.plot([], [], color=figures.BLUE, lw=0.9, label="predictor, one step")
        left = scored.sel(output=output)
        for name, colour in (("free_run", figures.ORANGE), ("one_step", figures.BLUE)):
            error.plot(left["time"], left["measured"] - left[name], color=colour, lw=0.7)
        signal.set_ylabel(f"{output} [{units[i]}]")
        error.set_ylabel(f"error of {output}")
    panels[0].set_title(f"{title}, samples held out")
    panels[-1].set_xlabel("time [samples]")
    figures.legend_below(figure, panels[0])
    return figure


def two_responses_figure(
    data: Dataset,
    title: str,
    model: InnovationsModel,
    deviations: Callable[[RealArray], RealArray | None],
) -> Figure:
    """Magnitudes of the simulator's and of the nonparametric response, with its 99 % radius.

    The simulator has its 95 % band if ``deviations`` at frequencies (F,) are known.

    For records without a nonparametric response, only the simulator's is shown.
    """
    rows, columns = data.sizes["output"], data.sizes["input"]
    figure, panels = figures.axes(rows, columns, size=(4.4 * columns, 3.2 * rows), sharex=True)
    frequency = data["frequency"].values
    # |error|^2 of a circular complex estimate is exponentially distributed around its variance.
    radius = np.sqrt(-np.log(0.01) * data["variance"]) if "variance" in data else None
    at = frequency[:: max(1, len(frequency) // BAND_POINTS)]
    spread, centre = deviations(at), np.abs(model.response(at))
    for k, panel in enumerate(panels):
        place = {"output": k // columns, "input": k % columns}
        one = data.isel(place)
        if radius is not None:
            panel.loglog(
                frequency, abs(one["nonparametric"]), ".", color=figures.BLUE, ms=2.5,
                label="nonparametric",
            )  # fmt: skip
            panel.loglog(
                frequency, radius.isel(place), color=figures.SKY, lw=0.7, label="its 99 % radius"
            )
        panel.loglog(frequency, abs(one["response"]), color=figures.ORANGE, label="simulator")
        output, source = str(one["output"].values), str(one["input"].values)
        across = "frequency [cycles/sample]" if k >= len(panels) - columns else ""
        unit = _gain_unit(model, k // columns, k % columns)
        up = f"magnitude, {output} [{unit}]" if k % columns == 0 or unit != "1" else ""
        if spread is not None:
            i, j = k // columns, k % columns
            half = BAND * spread[:, i, j]
            low = np.maximum(centre[:, i, j] - half, LEAST_BAND * centre[:, i, j])
            panel.fill_between(
                at, low, centre[:, i, j] + half, color=figures.ORANGE, alpha=0.25, lw=0,
                label="its 95 % band if errors are white",
            )  # fmt: skip
        figures.label(panel, x=across, y=up, title=f"{source} to {output}")
    figure.suptitle(title)
    figures.legend_below(figure, panels[0])
    return figure


def _gain_unit(model: InnovationsModel, output: int, source: int) -> str:
    """Unit of a response."""
    if not (model.input_units and model.output_units):
        return "1"
    up, down = model.output_units[output], model.input_units[source]
    if up == down:
        return "1"
    return up if down == "1" else f"{up}/{down}"


def residuals_figure(data: Dataset) -> Figure:
    """Correlations of the predictor's errors with their past and the inputs, and 99 % bounds."""
    outputs, inputs = data["output"].values, data["input"].values
    columns = 1 + len(inputs)
    figure, panels = figures.axes(len(outputs), columns, size=(3.2 * columns, 2.7 * len(outputs)))
    for k, panel in enumerate(panels):
        output, column = outputs[k // columns], k % columns
        if column == 0:
            values, axis = data["autocorrelation"].sel(output=output), "lag"
            panel.set_title(f"error of {output} with its past")
            panel.set_ylabel("standard deviations")
        else:
            source = inputs[column - 1]
            values, axis = data["cross_correlation"].sel(output=output, input=source), "shift"
            panel.set_title(f"error of {output} with {source}")
        panel.vlines(values[axis], 0, values, color=figures.BLUE, label="correlation")
        panel.axhspan(
            -CORRELATION_BOUND,
            CORRELATION_BOUND,
            color=figures.AMBER,
            alpha=0.25,
            lw=0,
            label="99 % if none",
        )
        if k >= len(panels) - columns:
            panel.set_xlabel("error later than input [samples]" if column else "lag [samples]")
    figures.legend_below(figure, panels[0])
    return figure


def validation_figure(data: Dataset) -> Figure:
    """Validation fits of predictors and of simulators over the order."""
    figure, panels = figures.axes(1, 2, size=(9.0, 4.0))
    fits = data["validation_fit"].where(np.isfinite(data["validation_fit"]))
    uses = (("one_step", "predictor"), ("free_run", "simulator"))
    for panel, (use, name) in zip(panels, uses, strict=True):
        one = fits.sel(use=use)
        for i, output in enumerate(data["output"].values):
            panel.plot(
                data["order"], one.sel(output=output), marker=".", color=figures.CYCLE[i],
                label=str(output),
            )  # fmt: skip
        panel.plot(
            data["order"], one.mean("output"), color=figures.BLACK, marker="o", ms=4,
            label="mean, which chooses",
        )  # fmt: skip
        chosen = data.sizes[f"{name}_state"]
        panel.axvline(chosen, color=figures.BLACK, lw=0.8, ls=":", label="chosen order")
        panel.set_title(f"{name}, {use.replace('_', ' ')}")
        panel.set_xlabel("order")
    panels[0].set_ylabel("fit in validation, as told [%]")
    figures.legend_below(figure, panels[0])
    return figure
