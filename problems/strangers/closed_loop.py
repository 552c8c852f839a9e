"""The C file closes the loop around the nonlinear simulation of each unit."""

from __future__ import annotations

import ctypes
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.types import RealArray

from .simulators.rig import Rig
from .simulators.stranger import Stranger

DRIVER = """
#include "controller.h"
static controller_state states[64];
void begin(int unit, double r, double y, double u)
{
    controller_real at[1] = {(controller_real)REST(r, y)}, now[1] = {(controller_real)u};
    controller_init(&states[unit]);
#ifdef ABSOLUTE_SIGNALS
    controller_real wanted[1] = {(controller_real)r};
    controller_start(&states[unit], wanted, at, now);
#else
    controller_start(&states[unit], at, now);
#endif
}
double advance(int unit, double r, double y)
{
    controller_real at[1] = {(controller_real)REST(r, y)}, u[1];
#ifdef ABSOLUTE_SIGNALS
    controller_real wanted[1] = {(controller_real)r};
    controller_step(&states[unit], wanted, at, u);
#else
    controller_step(&states[unit], at, u);
#endif
    return (double)u[0];
}
"""
ABSOLUTE = re.compile(r"_step\([^)]*\br\[")
"""A step function that takes set-points and measurements; in older headers it takes errors."""
QUIET, STEPPED, LOADED = 0.5, 2.0, 2.0
"""Durations of the rest, of the phase after the step and of that after the load, over the demanded
settling time.
"""
END = 0.3
"""Last part of a phase, over the settling time, in which the remaining error is judged."""


class CController:
    """A controller of one input and one output, compiled from its header.

    Raises `subprocess.CalledProcessError` if the compiler refuses the header.
    """

    def __init__(self, header: Path, folder: Path) -> None:
        absolute = ABSOLUTE.search(header.read_text(encoding="utf-8")) is not None
        source, library = folder / "driver.c", folder / "driver.so"
        source.write_text(DRIVER, encoding="utf-8")
        rest = ["-DABSOLUTE_SIGNALS", "-DREST(r,y)=(y)"] if absolute else ["-DREST(r,y)=((r)-(y))"]
        words = ["cc", "-O2", "-shared", "-fPIC", *rest, f"-I{header.parent}", str(source)]
        subprocess.run([*words, "-o", str(library)], check=True, capture_output=True, text=True)
        self._code = ctypes.CDLL(str(library))
        self._code.begin.argtypes = [ctypes.c_int, *[ctypes.c_double] * 3]
        self._code.advance.argtypes = [ctypes.c_int, *[ctypes.c_double] * 2]
        self._code.advance.restype = ctypes.c_double

    def begin(self, r: RealArray, y: RealArray, u: RealArray) -> None:
        """Start the controller of every unit at these set-points, measurements and controls
        (N,).
        """
        for k in range(len(r)):
            self._code.begin(k, r[k], y[k], u[k])

    def advance(self, r: RealArray, y: RealArray) -> RealArray:
        """Next controls (N,) of every unit."""
        return np.array([self._code.advance(k, r[k], y[k]) for k in range(len(r))])


@dataclass(frozen=True)
class Driven:
    """Time (T,); set-points, outputs and controls (T, N) of all units; and the samples at which
    phases end.
    """

    time: RealArray
    wanted: RealArray
    output: RealArray
    control: RealArray
    phases: tuple[int, int, int]


def driven(plant: Stranger, controller: CController, delay: float, seed: int) -> Driven:
    """Simulate every unit under the C file: at rest, after a step of the set-point, then under a
    load.

    The controls act ``delay`` [samples], rounded up, after the measurements. The plant limits the
    controls itself, whatever the controller says.
    """
    rig, rng, late = Rig(plant, plant.drawn()), np.random.default_rng(seed), int(np.ceil(delay))
    settling, demand = plant.demand.settling / plant.period, plant.demand
    begin = int(QUIET * settling)
    load = begin + int(STEPPED * settling)
    count = load + int(LOADED * settling)
    rest, waiting = rig.y_rest[0], [rig.u_rest[0]] * late
    controller.begin(rest, rig.read(rng)[0], rig.u_rest[0])
    wanted, outputs, controls = [], [], []
    for k in range(count):
        r = rest + (demand.step[0] if k >= begin else 0.0)
        waiting.append(controller.advance(r, rig.read(rng)[0]))
        wanted.append(r)
        outputs.append(rig.y[0])
        controls.append(waiting[-1])
        rig.advance(waiting.pop(0)[None], demand.load if k >= load else 0.0)
    time = plant.period * np.arange(count, dtype=float)
    phases = begin, load, count
    return Driven(time, np.array(wanted), np.array(outputs), np.array(controls), phases)


def verdicts(plant: Stranger, one: Driven) -> dict[str, RealArray]:
    """Measures of each unit (N,), each divided by the demand: met if at most 1.

    ``bump``: largest move of the output at rest, and of the first control. ``overshoot``,
    ``settling``: of the step response. ``error``: mean error at the end of both phases. ``cycle``:
    half the width of the oscillation that remains there. ``limits``: largest control beyond its
    limits. ``away``: share of the time that the control spends at a limit at the end of both
    phases, where no limit is needed.
    """
    demand, channel, actuator = plant.demand, plant.outputs[0], plant.inputs[0]
    step, (begin, load, count) = demand.step[0], one.phases
    tail = int(END * demand.settling / plant.period)
    left = max(channel.resolution, demand.dead_zone)
    noise = 3.0 * channel.noise + channel.resolution
    y, r, u = one.output, one.wanted, one.control
    span = actuator.high - actuator.low
    after = slice(begin, load)
    error = np.where(np.isfinite(y), y - r, np.inf)
    ends = [slice(end - tail, end) for end in (load, count)]
    outside = np.abs(error[after]) > 0.05 * abs(step) + noise
    last = np.where(outside.any(axis=0), outside.shape[0] - np.argmax(outside[::-1], axis=0), 0)
    widest = max(left, 0.05 * abs(step)) + noise
    at_limit = (u <= actuator.low + 1e-6 * span) | (u >= actuator.high - 1e-6 * span)
    with np.errstate(invalid="ignore"):
        return {
            "bump": np.maximum(
                np.abs(error[:begin]).max(axis=0) / (0.1 * abs(step) + noise),
                np.abs(u[0] - u[: max(begin, 1)].mean(axis=0)) / (0.1 * span),
            ),
            "overshoot": (np.sign(step) * error[after]).max(axis=0)
            / (demand.overshoot * abs(step) + noise),
            "settling": last * plant.period / demand.settling,
            "error": np.max([np.abs(error[end].mean(axis=0)) for end in ends], axis=0) / left,
            "cycle": np.max([np.ptp(error[end], axis=0) / 2 for end in ends], axis=0) / widest,
            "limits": np.maximum(u.max(axis=0) - actuator.high, actuator.low - u.min(axis=0)) / span
            + 1.0,
            "away": np.max([at_limit[end].mean(axis=0) for end in ends], axis=0) / 0.5,
        }
