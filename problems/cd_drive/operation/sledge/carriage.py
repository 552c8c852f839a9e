"""A lens on a moving carriage, and the bench that holds it on its track or in focus.

With lens and arm relative to the carriage, q, and the carriage's speed v = z',

    M q'' + C q' + K q = g Bl i - M 1 v',        lens x = q_1 + z,

where C has the back-EMF, as the carriage carries the magnets. The speeds q' + 1 v are states, so
that v itself is an input. Signals, diodes and filters are those of the laboratory.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from workbench.simulation import (
    Cascade,
    Controller,
    Converter,
    Part,
    SampledLoop,
    linear_controller,
)
from workbench.types import RealArray, StateSpace

from ...drive.actuator import specific_model
from ...drive.photo_diodes import diode_parameters, focus_diodes, normalise, radial_diodes
from ...drive.plants import ANTIALIASING, controller
from ...drive.tables import Axis
from ...laboratory.bench_setup import (
    DIODE_GAIN,
    INPUT_LIMIT,
    NOISE,
    OUTPUT_LIMIT,
    PERIOD,
    coil_gain,
    find_drive,
    optical_noise,
)

MEASUREMENTS = ("f_en", "sum", "d1", "d2")
OUTPUTS = ("u_last", "v_last")
"""Names of the outputs of the previous sample: control voltage and speed of the carriage."""
NOISE_BAND = 1750.0
"""Band [Hz] of the diodes' noise, as in the laboratory."""


class Carried(NamedTuple):
    """Signals (N,): true error, places of lens and carriage [m], control voltage [V], carriage's
    speed [m/s]; and the further signals of the law's parts by name.
    """

    error: RealArray
    lens: RealArray
    carriage: RealArray
    u: RealArray
    speed: RealArray
    parts: dict[str, RealArray]


@dataclass(frozen=True)
class CarriedBench:
    """One axis of a drive on a carriage that moves along this axis.

    noise: whether the diodes are noisy. bits: resolution of the converters; None: they saturate,
    but do not round. refine: number of steps per sample in which the optics are simulated.
    """

    axis: Axis
    drive: str
    noise: bool = True
    bits: int | None = 12
    refine: int = 1

    def run(
        self,
        law: Cascade,
        track: RealArray,
        speed: RealArray | None = None,
        false: RealArray | None = None,
        seed: int = 0,
    ) -> Carried:
        """Run a law from rest, see `law_beside`.

        track (N + 1,): place of track or layer at each sample [m]. speed (N,): added to the
        carriage's [m/s]. false (N + 1,): false displacement that the diodes see [m].
        """
        samples = len(track) - 1
        added = np.zeros((samples, 2))
        if speed is not None:
            added[:, 1] = speed
        seen = np.zeros(samples + 1) if false is None else false
        exogenous = np.column_stack([track, np.ones(samples + 1), seen])
        noise = np.zeros((samples, 2))
        if self.noise:
            rng, drive = np.random.default_rng(seed), find_drive(self.axis, self.drive)
            noise = optical_noise(rng, samples, drive, NOISE[self.axis], NOISE_BAND)
        run = _loop(self).run(law, added, exogenous, noise)
        (lens, carriage), (u, v) = run.position.T, run.command.T
        return Carried(track[:-1] - lens, lens, carriage, u, v, run.signals)


def law_beside(axis: Axis, *parts: Part) -> Cascade:
    """The axis' reference controller, which gives u, and parts that read it and give the carriage's
    speed v; without parts the law leaves the carriage alone.
    """
    K = Part("K", linear_controller(controller(axis), PERIOD), ["f_en"], outputs=["u_k"])
    names = ["u_k", "v"] if parts else ["u_k"]
    out = Part("out", passed_on(len(names)), names, outputs=["u", "speed"])
    return Cascade(MEASUREMENTS, [K, *parts, out], previous=OUTPUTS)


def carried_lens(axis: Axis, drive: str) -> StateSpace:
    """System from control voltage u [V] and carriage's speed v [m/s] to lens x and carriage z
    [m].
    """
    import control

    p = find_drive(axis, drive)
    actuator = specific_model(p)
    n = len(actuator.M)
    damper = actuator.C.copy()
    damper[0, 0] += actuator.Bl**2 / actuator.R
    inverse = np.linalg.inv(actuator.M)
    a, b, c = np.zeros((2 * n + 1, 2 * n + 1)), np.zeros((2 * n + 1, 2)), np.zeros((2, 2 * n + 1))
    a[:n, n:-1] = np.eye(n)
    a[n:-1, :n], a[n:-1, n:-1] = -inverse @ actuator.K, -inverse @ damper
    b[:n, 1], b[n:-1, 1], b[-1, 1] = -1.0, (inverse @ damper).sum(axis=1), 1.0
    b[n:-1, 0] = inverse[:, 0] * actuator.Bl / actuator.R * coil_gain(p)
    c[0, 0] = c[0, -1] = c[1, -1] = 1.0
    return control.ss(a, b, c, 0.0, inputs=["u", "v"], outputs=["x", "z"])


def passed_on(given: int) -> Controller:
    """Part that returns its one or two inputs as two outputs; what is not given is 0."""
    import control

    gain = control.ss([], [], [], np.eye(2)[:, :given])
    return linear_controller(gain, PERIOD, measurements=range(given))


@cache
def _loop(bench: CarriedBench) -> SampledLoop:
    eye = Converter(INPUT_LIMIT, bits=bench.bits).levels(gain=DIODE_GAIN)
    return SampledLoop(
        plant=carried_lens(bench.axis, bench.drive),
        positions=2,
        sense=focus_diodes if bench.axis == "focus" else radial_diodes,
        sense_parameters=diode_parameters(find_drive(bench.axis, bench.drive)),
        signals=2,
        corner=ANTIALIASING,
        read=normalise,
        read_parameters=np.array([Converter(INPUT_LIMIT).step / DIODE_GAIN]),
        measurements=len(MEASUREMENTS),
        channel_levels=np.tile(eye, (2, 1)),
        # the carriage's speed is no voltage: it passes as it is
        output_levels=np.array(
            [Converter(OUTPUT_LIMIT, bits=bench.bits).levels(), [0.0, -np.inf, np.inf]]
        ),
        dt=PERIOD,
        delay_samples=1.0,
        refine=bench.refine,
    )
