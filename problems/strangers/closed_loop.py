"""The C file closes the loop around the nonlinear simulation of each unit."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from workbench.types import RealArray

from .simulators.rig import Rig
from .simulators.stranger import Stranger

DRIVER = """
#include "controller.h"
static controller_state states[64];
void begin(int unit, const double *r, const double *y, const double *u)
{
    controller_real wanted[OUTPUTS], at[OUTPUTS], now[INPUTS];
    for (int i = 0; i < OUTPUTS; i++) {
        wanted[i] = (controller_real)r[i];
        at[i] = (controller_real)y[i];
    }
    for (int j = 0; j < INPUTS; j++) now[j] = (controller_real)u[j];
    controller_init(&states[unit]);
    controller_start(&states[unit], wanted, at, now);
}
void advance(int unit, const double *r, const double *y, double *u)
{
    controller_real wanted[OUTPUTS], at[OUTPUTS], next[INPUTS];
    for (int i = 0; i < OUTPUTS; i++) {
        wanted[i] = (controller_real)r[i];
        at[i] = (controller_real)y[i];
    }
    controller_step(&states[unit], wanted, at, next);
    for (int j = 0; j < INPUTS; j++) u[j] = (double)next[j];
}
"""
QUIET, STEPPED, LOADED = 0.5, 2.0, 2.0
"""Durations of the rest, of the phase after the step and of that after the load, over the demanded
settling time.
"""
END = 0.3
"""Last part of a phase, over the settling time, in which the remaining error is judged."""


class CController:
    """A controller of m controls and p measurements, compiled from its header.

    Raises `subprocess.CalledProcessError` if the compiler refuses the header.
    """

    def __init__(self, header: Path, folder: Path, sizes: tuple[int, int]) -> None:
        source, library = folder / "driver.c", folder / "driver.so"
        source.write_text(DRIVER, encoding="utf-8")
        self._controls = sizes[0]
        counts = [f"-DINPUTS={sizes[0]}", f"-DOUTPUTS={sizes[1]}"]
        words = ["cc", "-O2", "-shared", "-fPIC", *counts, f"-I{header.parent}", str(source)]
        subprocess.run([*words, "-o", str(library)], check=True, capture_output=True, text=True)
        numbers = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
        self._code = ctypes.CDLL(str(library))
        self._code.begin.argtypes = self._code.advance.argtypes = [ctypes.c_int, *[numbers] * 3]

    def begin(self, r: RealArray, y: RealArray, u: RealArray) -> None:
        """Start the controller of every unit at set-points (p, N), measurements (p, N) and controls
        (m, N).
        """
        for k in range(r.shape[1]):
            self._code.begin(k, *(np.ascontiguousarray(one[:, k]) for one in (r, y, u)))

    def advance(self, r: RealArray, y: RealArray) -> RealArray:
        """Next controls (m, N) of every unit."""
        u = np.empty((r.shape[1], self._controls))
        for k, row in enumerate(u):
            self._code.advance(k, np.ascontiguousarray(r[:, k]), np.ascontiguousarray(y[:, k]), row)
        return u.T


@dataclass(frozen=True)
class Driven:
    """Time (T,); set-points (T, p, N), outputs (T, p, N) and controls (T, m, N) of all units; and
    the samples at which phases end.
    """

    time: RealArray
    wanted: RealArray
    output: RealArray
    control: RealArray
    phases: tuple[int, int, int]


def driven(
    plant: Stranger, controller: CController, delay: float, seed: int, *, noise: bool = True
) -> Driven:
    """Simulate every unit under the C file: at rest, after a step of all set-points, then under a
    load.

    The controls act ``delay`` [samples], rounded up, after the measurements. The plant limits the
    controls itself, whatever the controller says. Without noise the converters still round.
    """
    if not noise:
        plant = replace(plant, outputs=tuple(replace(one, noise=0.0) for one in plant.outputs))
    rig, rng, late = Rig(plant, plant.drawn()), np.random.default_rng(seed), int(np.ceil(delay))
    settling, demand = plant.demand.settling / plant.period, plant.demand
    begin = int(QUIET * settling)
    load = begin + int(STEPPED * settling)
    count = load + int(LOADED * settling)
    rest, waiting = rig.y_rest, [rig.u_rest] * late
    step = np.array(demand.step)[:, None]
    controller.begin(rest, rig.read(rng), rig.u_rest)
    wanted, outputs, controls = [], [], []
    for k in range(count):
        r = rest + (step if k >= begin else 0.0)
        waiting.append(controller.advance(r, rig.read(rng)))
        wanted.append(r)
        outputs.append(rig.y)
        controls.append(waiting[-1])
        rig.advance(waiting.pop(0), demand.load if k >= load else 0.0)
    time = plant.period * np.arange(count, dtype=float)
    phases = begin, load, count
    return Driven(time, np.array(wanted), np.array(outputs), np.array(controls), phases)


def verdicts(plant: Stranger, one: Driven, quiet: Driven) -> dict[str, RealArray]:
    """Measures of each unit (N,), each divided by the demand: met if at most 1.

    ``bump``: largest move of an output at rest, and of the first control. ``overshoot``,
    ``settling``: of the step response. ``error``: mean error at the end of both phases. ``cycle``:
    half the width of the oscillation that remains there. ``limits``: largest control beyond its
    limits. ``away``: share of the time that a control spends at a limit at the end of both phases,
    where no limit is needed. Of several channels the worst counts. The error is that of ``quiet``,
    the loop without noise of the sensors: their noise moves the mean of a short stretch, too, and
    this is no static error.
    """
    of_outputs = [
        _of_output(plant, i, one.output[:, i] - one.wanted[:, i], one.phases)
        for i in range(len(plant.outputs))
    ]
    for i, found in enumerate(of_outputs):
        still = _of_output(plant, i, quiet.output[:, i] - quiet.wanted[:, i], quiet.phases)
        found["noisy error"], found["error"] = found["error"], still["error"]
    of_inputs = [
        _of_input(plant, j, one.control[:, j], one.phases) for j in range(len(plant.inputs))
    ]
    worst: dict[str, RealArray] = {}
    for found in (*of_outputs, *of_inputs):
        for name, values in found.items():
            worst[name] = np.maximum(worst.get(name, -np.inf), values)
    return worst


def _of_output(
    plant: Stranger, i: int, error: RealArray, phases: tuple[int, int, int]
) -> dict[str, RealArray]:
    """Measures (N,) of an output, from its error (T, N)."""
    demand, channel, step = plant.demand, plant.outputs[i], plant.demand.step[i]
    begin, load, count = phases
    tail = int(END * demand.settling / plant.period)
    left = max(channel.resolution, demand.dead_zone)
    noise = 3.0 * channel.noise + channel.resolution
    error = np.where(np.isfinite(error), error, np.inf)
    after = error[begin:load]
    ends = [error[end - tail : end] for end in (load, count)]
    outside = np.abs(after) > 0.05 * abs(step) + noise
    last = np.where(outside.any(axis=0), outside.shape[0] - np.argmax(outside[::-1], axis=0), 0)
    widest = max(left, 0.05 * abs(step)) + noise
    with np.errstate(invalid="ignore"):
        return {
            "bump": np.abs(error[:begin]).max(axis=0) / (0.1 * abs(step) + noise),
            "overshoot": (np.sign(step) * after).max(axis=0)
            / (demand.overshoot * abs(step) + noise),
            "settling": last * plant.period / demand.settling,
            "error": np.max([np.abs(end.mean(axis=0)) for end in ends], axis=0) / left,
            "cycle": np.max([np.ptp(end, axis=0) / 2 for end in ends], axis=0) / widest,
        }


def _of_input(
    plant: Stranger, j: int, u: RealArray, phases: tuple[int, int, int]
) -> dict[str, RealArray]:
    """Measures (N,) of an input u (T, N)."""
    actuator, (begin, load, count) = plant.inputs[j], phases
    tail = int(END * plant.demand.settling / plant.period)
    span = actuator.high - actuator.low
    at_limit = (u <= actuator.low + 1e-6 * span) | (u >= actuator.high - 1e-6 * span)
    ends = [slice(end - tail, end) for end in (load, count)]
    return {
        "bump": np.abs(u[0] - u[: max(begin, 1)].mean(axis=0)) / (0.1 * span),
        "limits": np.maximum(u.max(axis=0) - actuator.high, actuator.low - u.min(axis=0)) / span
        + 1.0,
        "away": np.max([at_limit[end].mean(axis=0) for end in ends], axis=0) / 0.5,
    }
