"""The C file closes the loop with each nonlinear unit."""

from __future__ import annotations

import ctypes
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench._core.arrays import RealArray

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
"""A step that takes set-points beside measurements; an older one takes errors."""
QUIET, STEPPED, LOADED = 0.5, 2.0, 2.0
"""Times at rest, after the step and after the load, over the demanded settling time."""
END = 0.3
"""Part of a phase at its end, over the settling time, in which what is left is judged."""


class CController:
    """A controller of one input and one output, compiled from its header.

    Raises `subprocess.CalledProcessError` where the compiler refuses it.
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
        """Start every unit from set-points, measurements and controls (N,) as they are."""
        for k in range(len(r)):
            self._code.begin(k, r[k], y[k], u[k])

    def advance(self, r: RealArray, y: RealArray) -> RealArray:
        """Controls (N,) of every unit."""
        return np.array([self._code.advance(k, r[k], y[k]) for k in range(len(r))])


@dataclass(frozen=True)
class Driven:
    """Time (T,), set-points, outputs and controls (T, N) of all units, and where phases begin."""

    time: RealArray
    wanted: RealArray
    output: RealArray
    control: RealArray
    phases: tuple[int, int, int]


def driven(plant: Stranger, controller: CController, delay: float, seed: int) -> Driven:
    """Every unit from rest through a step of the set-point and a load, by the C file.

    The computer takes ``delay`` [samples], rounded up, from measurement to control. The plant has
    its own limits, whatever the controller says.
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
    """What became of each unit (N,), each number over what is demanded: at most 1 is well.

    ``bump``: largest move of the output at rest, and of the first control. ``overshoot``,
    ``settling``: of the step. ``error``: mean error at the end of both phases. ``cycle``: half the
    width of what still moves there. ``limits``: largest control beyond its limits. ``away``: the
    share of the time at a limit at the end of both phases, where none is needed.
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
