"""Judge a stranger by its true plant: does the chain keep its promises, and what does its C file
do?
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from workbench import Check, figures, problem
from workbench.executor import Context
from workbench.study import markdown_table
from workbench.types import Dataset, Figure, RealArray

from .chain import Delivered, RefusedError, Way, delivered
from .closed_loop import CController, Driven, driven, verdicts
from .judge import (
    bandwidth_of_simc,
    broken_weights,
    excess_of_cover,
    grid,
    true_responses,
)
from .simulators.stranger import Stranger
from .study import DELAY, StrangerStudy

LEAST_BANDWIDTH = 0.5
"""Demanded certified bandwidth, over the bandwidth of a SIMC controller."""
MEASURES = ("bump", "overshoot", "settling", "error", "cycle", "limits", "away")
"""Measures of the simulated loop; each is at most 1 if the demand is met."""


@problem(
    "strangers/{plant}/loop",
    plant=(
        "heater",
        "coupled-tanks",
        "dc-motor",
        "flexible-arm",
        "two-mass-drive",
        "levitation",
        "boiler-level",
        "quadrotor-roll",
        "hydraulic-cylinder",
        "disk-arm",
        "mixing-tank",
        "ph",
    ),
    slow=True,
)
def loop(plant: str) -> StrangerLoop:
    """A plant that the workbench never saw, from its loggers' files to C in its nonlinear loop.

    The records of all units go through `workbench init` and `workbench run` in an empty folder, and
    the controller through a C compiler. The C file then drives each nonlinear unit through a step
    and a load. The promises are compared with the true linear plants, the loop with demands that
    were fixed beforehand, and the certified bandwidth with that of a SIMC controller designed for
    the true nominal plant.
    """
    return StrangerLoop(plant)


@dataclass(frozen=True, eq=False)
class StrangerLoop(StrangerStudy):
    """One stranger, from its loggers' files to the C file in the loop with each nonlinear unit."""

    headline: ClassVar[str] = "worst"

    def compute(self, context: Context) -> Dataset:
        with tempfile.TemporaryDirectory(prefix="stranger-") as place:
            way = Way(Path(place))
            try:
                if len(self.stranger.inputs) > 1:
                    raise RefusedError("`workbench init` takes plants of one input and one output")
                found = delivered(self.plant, self.stranger, way, grid(self.stranger))
                data = self._judged(found, Path(place))
            except RefusedError as error:
                data = self._refused(str(error))
            data.attrs["seconds"] = [step[2] for step in way.steps] or [0.0]
            lines = [line for *_, said in way.steps for line in said.splitlines()]
            warned = [line for line in lines if line.startswith("!")]
            data.attrs["warnings"] = "\n".join(warned)
        return data

    def _refused(self, reason: str) -> Dataset:
        """The data that are stored if the chain stops early."""
        import xarray as xr

        simc = bandwidth_of_simc(self.stranger, DELAY) if len(self.stranger.inputs) == 1 else np.nan
        return xr.Dataset(
            {"simc_bandwidth": ((), simc, {"units": "Hz"})}, attrs={"refused": reason}
        )

    def _judged(self, found: Delivered, place: Path) -> Dataset:
        """Judgement of the delivered controller: promises against the true plants, and the
        simulated loop.
        """
        import xarray as xr

        plant, omega = self.stranger, grid(self.stranger)
        _, G = true_responses(plant, omega)
        given = found.responses
        excess = excess_of_cover(G, given["nominal"], given["W_c"], given["W_r"], found.form)
        low, high = (2 * np.pi * one for one in found.band)
        used = (omega >= low) & (omega <= high)
        design = found.runs["controller"]
        late = (DELAY + 0.5) * plant.period
        weights = broken_weights(G, given["K"], omega, late, design["parameters"])
        one = driven(plant, CController(found.header, place), DELAY, plant.seed + 1000)
        said = verdicts(plant, one)
        units = ("unit",)
        return xr.Dataset(
            {
                "excess": (units, excess[used].max(axis=0)),
                "excess_everywhere": (units, excess.max(axis=0)),
                "worst_frequency": (
                    units,
                    omega[excess.argmax(axis=0)] / (2 * np.pi),
                    {"units": "Hz"},
                ),
                "weight": (units, weights),
                "verdict": (("measure", "unit"), np.array([said[name] for name in MEASURES])),
                "certified_bandwidth": (
                    *((), float(design["parameters"]["bandwidth"])),
                    {"units": "Hz"},
                ),
                "simc_bandwidth": ((), bandwidth_of_simc(plant, DELAY), {"units": "Hz"}),
                "peak": ((), float(design["metrics"].get("peak", np.nan))),
                "states": ((), float(found.runs["board"]["states"] or np.nan)),
                "unproven": ((), float(sum(not run["holds"] for run in found.runs.values()))),
                **_time_series(one, plant),
            },
            coords={
                "measure": list(MEASURES),
                "unit": np.arange(1, plant.units + 1),
                "time": ("time", one.time, {"units": "s"}),
            },
            attrs={"refused": ""},
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        refused = float(bool(answer.attrs["refused"]))
        if self.stranger.refusable:
            warned = bool(answer.attrs["warnings"]) or refused
            silent = 0.0 if warned else float(self._worst(answer) > 1.0)
            return [Check("not in silence", "demands that are missed without a warning", silent, 0)]
        checks = [Check("way", "commands of the chain that refused", refused, 0)]
        return checks + [Check(*one, limit=1.0) for one in self._promises(answer)]

    def _promises(self, answer: Dataset) -> list[tuple[str, str, float]]:
        """Names, statements and numbers of all promises; each is kept if its number is at
        most 1.
        """
        if answer.attrs["refused"]:
            return []
        wanted = LEAST_BANDWIDTH * float(answer["simc_bandwidth"])
        told = [
            ("cover", "distance of a true plant over the cover's", float(answer["excess"].max())),
            ("weights", "weighted error of a true linear plant", float(answer["weight"].max())),
            ("proven", "results without a certificate, and 1", float(answer["unproven"]) + 1.0),
            (
                *("bandwidth", "half the bandwidth of a SIMC controller, over the certified one"),
                wanted / float(answer["certified_bandwidth"]),
            ),
        ]
        for name in MEASURES:
            worst = float(answer["verdict"].sel(measure=name).max())
            told.append((name, f"{name} of a unit, over what is demanded", worst))
        return told

    def _worst(self, answer: Dataset) -> float:
        """The largest number of all promises; infinite if the chain refused."""
        return max((value for *_, value in self._promises(answer)), default=np.inf)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        told = {name: value for name, _, value in self._promises(answer)}
        if told:  # nothing is promised outside the measured band
            told["cover_everywhere"] = float(answer["excess_everywhere"].max())
        return {"worst": self._worst(answer), **told}

    def tables(self, answer: Dataset) -> dict[str, str]:
        if answer.attrs["refused"]:
            return {"judgement": markdown_table(["refused"], [[answer.attrs["refused"]]])}
        rows = [
            [name, statement, f"{value:.3g}", "kept" if value <= 1.0 else "missed"]
            for name, statement, value in self._promises(answer)
        ]
        return {"judgement": markdown_table(["what", "number", "at most 1", "verdict"], rows)}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        if answer.attrs["refused"]:
            return {}
        return {"loop": _loop_figure(answer, self.stranger)}


def _time_series(one: Driven, plant: Stranger) -> dict[str, Any]:
    """Time series as variables of a dataset."""
    both = ("time", "unit")
    output, actuator = plant.outputs[0], plant.inputs[0]
    return {
        "wanted": (both, one.wanted, {"units": output.unit}),
        "output": (both, one.output, {"units": output.unit, "long_name": output.name}),
        "control": (both, one.control, {"units": actuator.unit, "long_name": actuator.name}),
    }


def _loop_figure(answer: Dataset, plant: Stranger) -> Figure:
    """Figure of all units: outputs relative to their values at rest, and controls."""
    figure, (top, bottom) = figures.axes(2, 1, size=(7.0, 5.4), sharex=True)
    time: RealArray = answer["time"].values
    rest = answer["wanted"].values[0]
    top.plot(time, answer["output"].values - rest, linewidth=0.9)
    top.plot(time, answer["wanted"].values[:, 0] - rest[0], "k:", linewidth=1.0)
    bottom.plot(time, answer["control"].values, linewidth=0.9)
    step = plant.demand.step[0]
    low, high = sorted((-0.8 * step, 2.2 * step))
    top.set_ylim(low, high)
    figures.label(top, y=f"{plant.outputs[0].name} from rest [{plant.outputs[0].unit}]")
    figures.label(bottom, x="time [s]", y=figures.axis_label(answer["control"], "control"))
    top.set_title(f"{plant.title}: {plant.units} units")
    return figure
