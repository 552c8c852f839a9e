"""A multisine in the loop of a drive, and its record as the methods for closed loops take it.

Between 100 Hz and 3.5 kHz the plant falls by a factor of two thousand, and white noise of the
measured position covers it up to 1750 Hz. Few lines, evenly spread over the logarithm of frequency,
leave little noise at each; their sizes lie half way between those of a flat input of the plant's
loop and of a flat motion of the lens.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import butter, sosfilt

from workbench import solve
from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import SolverError
from workbench.identification import Multisine, RationalModelFit, schroeder_phases
from workbench.simulation import linear_controller

from ...drive.disc import Disc
from ...drive.plants import controller
from ...drive.tables import Axis, red_book
from ..bench_setup import PERIOD, RATE
from ..experiment import Laboratory
from ..in_the_loop import DISC_SHARE, ERROR_SWING, LOOP_SETTLING, ROTATION, controller_response
from ..record import Record

SAMPLES = 4200
"""Samples of a period of the multisine: its lines are multiples of 8.3 Hz."""
BAND, LINES = (100.0, 3500.0), 40
"""Band [Hz] of the multisine and number of its lines."""
LARGEST_INPUT = 4.0
"""Peak [V] of the multisine, and of its part in u, in the nominal loop. Noise adds 0.8 V rms to u
of CD1 and 1.2 V to that of CD8; the converter ends at 10 V."""
LOW_CUT = 60.0
"""Corner [Hz] of the high-pass filter that takes the turning disc out of all signals alike."""
CONTROLLER_ORDER, CONTROLLER_ERROR = 3, 1e-3
"""Order and largest relative error of the controller's model at a lower sampling rate."""


@dataclass(frozen=True, eq=False)
class LoopSignals:
    """Excitation r, input u and output y (N,) of the plant, sampled every `step` [s].

    period: samples of a period of r.
    """

    r: RealArray
    u: RealArray
    y: RealArray
    step: float
    period: int


@dataclass(frozen=True, eq=False)
class MultisineExperiment:
    """A multisine of some periods in the loop of a drive under the reference controller."""

    bench: Laboratory
    periods: int

    @cached_property
    def multisine(self) -> Multisine:
        """The multisine [V] that reaches one of the limits in the nominal loop.

        It moves the error by ERROR_SWING, or the plant's input by LARGEST_INPUT. Its phases are
        Schroeder's for the lens or for the input, whichever allows it to be larger.
        """
        lines = np.unique(np.rint(np.geomspace(*BAND, LINES) * SAMPLES / RATE).astype(int))
        axis, frequency = self.bench.axis, lines * RATE / SAMPLES
        nominal = Laboratory(axis, "nominal")
        plant = -nominal.response(frequency)["f_en"]  # the sign of eq. 3.16
        to_input = 1 / (1 + plant * controller_response(axis, frequency))
        to_lens = plant * to_input / nominal.parameters.K_optn
        sizes = abs(to_lens) ** -0.5
        limits = (
            (np.ones(len(lines)), LARGEST_INPUT),
            (to_input, LARGEST_INPUT),
            (to_lens, ERROR_SWING[axis]),
        )
        designs = []
        for flat in (to_input, to_lens):
            phases = schroeder_phases(lines, sizes * abs(flat)) - np.angle(flat)
            peaks = [_peak(lines, sizes * np.exp(1j * phases) * way) / top for way, top in limits]
            designs.append(Multisine(lines, sizes / max(peaks), phases, SAMPLES))
        return max(designs, key=lambda one: float(one.amplitudes.sum()))

    def played(self, seed: int) -> tuple[RealArray, Record]:
        """The excitation [V] (N,), after the loop has settled, and the record."""
        axis = self.bench.axis
        rest = np.zeros(round(LOOP_SETTLING * RATE))
        signal = np.append(rest, np.tile(self.multisine.period(), self.periods))
        disc = Disc.along(axis, DISC_SHARE * red_book(axis).deviation, rotation=ROTATION)
        law = linear_controller(controller(axis), PERIOD)
        return signal, self.bench.closed_loop(law, signal, disc=disc, seed=seed)


def signals(excitation: RealArray, record: Record, every: int) -> LoopSignals:
    """Every so many samples of r, u and f_en, high-passed alike, without the first period.

    There is no filter against aliasing: nothing is excited above half the lower rate, noise that
    is folded stays noise, and such a filter would let u depend on later samples of y.
    """
    high = butter(2, LOW_CUT, "highpass", fs=RATE, output="sos")
    settled = round(LOOP_SETTLING * RATE) + SAMPLES
    r, u, y = (sosfilt(high, one)[settled::every] for one in (excitation, record.u, record.f_en))
    return LoopSignals(r, u, y, every * PERIOD, SAMPLES // every)


def sampled_controller(axis: Axis, every: int) -> StateSpace:
    """The controller from f_en to -u as it acts on every so many samples.

    It is fitted to the known response in the multisine's band; a controller that is transformed
    anew at the lower rate would differ from it at the high frequencies.
    """
    frequency, step = np.geomspace(*BAND, 100), every * PERIOD
    response = -controller_response(axis, frequency)
    variance = abs(CONTROLLER_ERROR * response) ** 2
    program = RationalModelFit(
        2 * np.pi * frequency,
        response,
        variance,
        orders=(CONTROLLER_ORDER,),
        excess=0,
        dt=step,
        stable=True,
    )
    law = solve(program).answer.model.lti
    fitted = law(np.exp(2j * np.pi * frequency * step), squeeze=False)[0, 0]
    apart = float(abs(fitted / response - 1).max())
    if apart > CONTROLLER_ERROR:
        raise SolverError(f"the controller at every {every} samples is off by {apart:.2g}")
    return law


def _peak(lines: np.ndarray, amplitudes: ComplexArray) -> float:
    """Largest magnitude in a period of a multisine of complex amplitudes."""
    one = Multisine(lines, abs(amplitudes), np.angle(amplitudes), SAMPLES)
    return float(abs(one.period()).max())
