"""The true linear plants of each stranger, from numerical derivatives of its equations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import expm

from workbench import Check, figures, problem
from workbench.executor import Context
from workbench.types import Dataset, Figure

from .judge import bandwidth_of_simc, grid, true_responses
from .simulators.linear import linear_plants
from .simulators.rig import Rig
from .simulators.stranger import Array, Stranger
from .study import DELAY, StrangerStudy

SMALL, SAMPLES, HALF_PERIOD = 1e-4, 60, 7
"""Size of the test signal over the input's range, its length and its half period [samples]."""
NONLINEAR = 0.05
"""Largest accepted difference between equations and linear plants for this signal, over the largest
output.
"""


@problem(
    "strangers/{plant}/truth",
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
)
def truth(plant: str) -> StrangerTruth:
    """The true linear plants of a stranger's units near rest, and a SIMC controller's bandwidth."""
    return StrangerTruth(plant)


@dataclass(frozen=True, eq=False)
class StrangerTruth(StrangerStudy):
    """Responses of the true linear plants, and whether the equations agree with them near rest."""

    headline: ClassVar[str] = "apart"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        plant = self.stranger
        omega = grid(plant)
        every, G = true_responses(plant, omega)
        over = ("frequency", "unit", "output", "input")
        simc = bandwidth_of_simc(plant, DELAY)
        unstable = [int((one.poles.real > 1e-9 * np.abs(one.poles).max()).sum()) for one in every]
        return xr.Dataset(
            {
                "response": (over, G),
                "apart": ("unit", differences(plant)),
                "unstable_poles": ("unit", np.array(unstable, dtype=float)),
                "simc_bandwidth": ((), simc, {"units": "Hz"}),
            },
            coords={
                "frequency": ("frequency", omega / (2 * np.pi), {"units": "Hz"}),
                "unit": np.arange(1, plant.units + 1),
                "output": [one.name for one in plant.outputs],
                "input": [one.name for one in plant.inputs],
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        apart = float(answer["apart"].max())
        return [Check("linear", "equations from linear plants, relative", apart, NONLINEAR)]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        return {
            "apart": float(answer["apart"].max()),
            "simc_bandwidth_hz": float(answer["simc_bandwidth"]),
            "unstable_poles": float(answer["unstable_poles"].max()),
        }

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        first = answer["response"].isel(output=0, input=0)
        curves = {f"unit {one}": first.sel(unit=one).values for one in answer["unit"].values}
        unit = f"{self.stranger.outputs[0].unit}/{self.stranger.inputs[0].unit}"
        return {"bode": figures.bode_plot(answer["frequency"].values, curves, unit)}


def differences(plant: Stranger) -> Array:
    """Largest difference (N,) between equations and linear plants, for a small square wave.

    It is relative to the largest output of the unit. Both are without dry friction and backlash.
    """
    p = plant.linear(plant.drawn())
    rig, every = Rig(plant, p), linear_plants(plant, plant.drawn())
    size = SMALL * np.array([[one.high - one.low] for one in plant.inputs])
    step = plant.period / plant.substeps
    worst = np.zeros(plant.units)
    largest = np.full(plant.units, np.finfo(float).tiny)
    states = [np.zeros(len(one.A)) for one in every]
    moves = [_discretised(one.A, one.B, step) for one in every]
    late = [round(one.delay / step) for one in every]
    past: list[Array] = [np.zeros(len(plant.inputs))] * (max(late) + 1)
    for k in range(SAMPLES):
        wave = size[:, 0] * (1.0 if k // HALF_PERIOD % 2 == 0 else -1.0)
        rig.advance(rig.u_rest + wave[:, None])
        for _ in range(plant.substeps):
            past = [wave, *past[:-1]]
            for n, (Phi, Gamma) in enumerate(moves):
                states[n] = Phi @ states[n] + Gamma @ past[late[n]]
        linear = np.stack([one.C @ x for one, x in zip(every, states, strict=True)], axis=1)
        actual = rig.y - rig.y_rest
        worst = np.maximum(worst, np.abs(actual - linear).max(axis=0))
        largest = np.maximum(largest, np.abs(linear).max(axis=0))
    apart: Array = worst / largest
    return apart


def _discretised(A: Array, B: Array, step: float) -> tuple[Array, Array]:
    """Transition matrix of the states and input matrix of a held input, over one step."""
    n, m = B.shape
    both = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * step)
    return both[:n, :n], both[:n, n:]
