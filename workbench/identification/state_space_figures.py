"""Figures of an identified state-space model, from its dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from workbench import figures
from workbench.identification.validation import BOUND

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def held_out(data: xr.Dataset, title: str) -> Figure:
    """Measured and modelled outputs, and what is left, on the samples held out."""
    outputs = data["output"].values
    figure, panels = figures.axes(
        2 * len(outputs), 1, size=(8.0, 2.1 * 2 * len(outputs)), sharex=True
    )
    scored = data.isel(time=slice(int(data.attrs["washout"]), None))
    for i, output in enumerate(outputs):
        signal, error = panels[2 * i], panels[2 * i + 1]
        one = data.sel(output=output)
        signal.plot(one["time"], one["measured"], color=figures.BLACK, lw=0.9, label="measured")
        signal.plot(one["time"], one["free_run"], color=figures.ORANGE, lw=0.9, label="free run")
        signal.plot([], [], color=figures.BLUE, lw=0.9, label="one step")
        left = scored.sel(output=output)
        for name, colour in (("free_run", figures.ORANGE), ("one_step", figures.BLUE)):
            error.plot(left["time"], left["measured"] - left[name], color=colour, lw=0.7)
        signal.set_ylabel(str(output))
        error.set_ylabel(f"error of {output}")
    panels[0].set_title(f"{title}, samples held out")
    panels[-1].set_xlabel("time [samples]")
    figures.legend_below(figure, panels[0])
    return figure


def response(data: xr.Dataset, title: str) -> Figure:
    """Magnitudes of the model and of the nonparametric response with its 99 % radius."""
    rows, columns = data.sizes["output"], data.sizes["input"]
    figure, panels = figures.axes(rows, columns, size=(4.4 * columns, 3.2 * rows), sharex=True)
    frequency = data["frequency"].values
    # |error|^2 of a circular complex estimate is exponentially distributed around its variance.
    radius = np.sqrt(-np.log(0.01) * data["variance"])
    for k, panel in enumerate(panels):
        place = {"output": k // columns, "input": k % columns}
        one = data.isel(place)
        panel.loglog(
            frequency, abs(one["nonparametric"]), ".", color=figures.BLUE, ms=2.5,
            label="nonparametric",
        )  # fmt: skip
        panel.loglog(
            frequency, radius.isel(place), color=figures.SKY, lw=0.7, label="its 99 % radius"
        )
        panel.loglog(frequency, abs(one["response"]), color=figures.ORANGE, label="model")
        output, source = str(one["output"].values), str(one["input"].values)
        panel.set_title(f"{source} to {output}")
        if k >= len(panels) - columns:
            panel.set_xlabel("frequency [cycles/sample]")
        if k % columns == 0:
            panel.set_ylabel(f"magnitude, {output} [1]")
    figure.suptitle(title)
    figures.legend_below(figure, panels[0])
    return figure


def residuals(data: xr.Dataset) -> Figure:
    """Correlations of one-step errors with their past and with the inputs, and the 99 % bound."""
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
        panel.axhspan(-BOUND, BOUND, color=figures.AMBER, alpha=0.25, lw=0, label="99 % if none")
        if k >= len(panels) - columns:
            panel.set_xlabel("error later than input [samples]" if column else "lag [samples]")
    figures.legend_below(figure, panels[0])
    return figure


def validation(data: xr.Dataset) -> Figure:
    """Fits within the estimation part over the order."""
    figure, (panel,) = figures.axes(size=(7.0, 4.0))
    fits = data["validation_fit"].where(np.isfinite(data["validation_fit"]))
    for i, output in enumerate(data["output"].values):
        for kind, style in (("one_step", "-"), ("free_run", "--")):
            panel.plot(
                data["order"],
                fits.sel(output=output, kind=kind),
                style,
                marker=".",
                color=figures.CYCLE[i],
                label=f"{kind.replace('_', ' ')}, {output}",
            )
    panel.plot(
        data["order"], fits.mean(["kind", "output"]), color=figures.BLACK, marker="o", ms=4,
        label="mean, which chooses",
    )  # fmt: skip
    panel.axvline(data.sizes["state"], color=figures.BLACK, lw=0.8, ls=":", label="chosen order")
    panel.set_xlabel("order")
    panel.set_ylabel("fit in validation [%]")
    figures.legend_below(figure, panel, columns=3)
    return figure
