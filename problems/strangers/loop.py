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

        simc = bandwidth_of_simc(self.stranger, DELAY)
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
        low, high = np.moveaxis(2 * np.pi * found.bands, -1, 0)
        at = omega[:, None, None]
        used = ((at >= low) & (at <= high))[:, None]
        largest = excess.max(axis=(2, 3))
        design = found.runs["controller"]
        bandwidth = float(design["parameters"]["bandwidth"])
        late = (DELAY + 0.5) * plant.period
        weights = broken_weights(G, given["K"], omega, late, bandwidth, found.sizes)
        code = CController(found.header, place, (len(plant.inputs), len(plant.outputs)))
        one, quiet = (
            driven(plant, code, DELAY, plant.seed + 1000, noise=noise) for noise in (True, False)
        )
        said = verdicts(plant, one, quiet)
        units = ("unit",)
        return xr.Dataset(
            {
                "excess": (units, (excess * used).max(axis=(0, 2, 3))),
                "excess_everywhere": (units, largest.max(axis=0)),
                "worst_frequency": (
                    units,
                    omega[largest.argmax(axis=0)] / (2 * np.pi),
                    {"units": "Hz"},
                ),
                "weight": (units, weights),
                "verdict": (("measure", "unit"), np.array([said[name] for name in MEASURES])),
                "noisy_error": (units, said["noisy error"]),
                "certified_bandwidth": ((), bandwidth, {"units": "Hz"}),
                "simc_bandwidth": ((), bandwidth_of_simc(plant, DELAY), {"units": "Hz"}),
                "peak": ((), float(design["metrics"].get("peak", np.nan))),
                "states": ((), float(found.runs["board"]["states"] or np.nan)),
                "unproven": ((), float(sum(not run["holds"] for run in found.runs.values()))),
                **_time_series(one),
            },
            coords={
                "measure": list(MEASURES),
                "unit": np.arange(1, plant.units + 1),
                "time": ("time", one.time, {"units": "s"}),
                "output_name": [channel.name for channel in plant.outputs],
                "input_name": [channel.name for channel in plant.inputs],
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
            told["error_with_noise"] = float(answer["noisy_error"].max())
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
        return {"loop": loop_figure(answer, self.stranger)}


def _time_series(one: Driven) -> dict[str, Any]:
    """Time series as variables of a dataset."""
    outputs, inputs = (("time", name, "unit") for name in ("output_name", "input_name"))
    return {
        "wanted": (outputs, one.wanted),
        "output": (outputs, one.output),
        "control": (inputs, one.control),
    }


def loop_figure(answer: Dataset, plant: Stranger) -> Figure:
    """Figure of all units: outputs relative to their values at rest, and controls."""
    channels = [("output", one) for one in plant.outputs] + [
        ("control", one) for one in plant.inputs
    ]
    figure, panels = figures.axes(len(channels), 1, size=(7.0, 2.7 * len(channels)), sharex=True)
    time: RealArray = answer["time"].values
    place = {"output": 0, "control": 0}
    for panel, (kind, channel) in zip(panels, channels, strict=True):
        k = place[kind]
        place[kind] += 1
        values = answer[kind].values[:, k]
        if kind == "control":
            panel.plot(time, values, linewidth=0.9)
            figures.label(panel, y=f"{channel.name} [{channel.unit}]")
            continue
        wanted, step = answer["wanted"].values[:, k], plant.demand.step[k]
        panel.plot(time, values - wanted[0], linewidth=0.9)
        panel.plot(time, wanted[:, 0] - wanted[0, 0], "k:", linewidth=1.0)
        panel.set_ylim(*sorted((-0.8 * step, 2.2 * step)))
        figures.label(panel, y=f"{channel.name} from rest [{channel.unit}]")
    figures.label(panels[-1], x="time [s]")
    panels[0].set_title(f"{plant.title}: {plant.units} units")
    return figure
