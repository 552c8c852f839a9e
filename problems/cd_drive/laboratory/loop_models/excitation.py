"""A multisine in the loop of a drive, and its record in the form that closed-loop methods take.

Between 100 Hz and 3.5 kHz the plant's gain falls by a factor of two thousand, and white noise of
the measured position covers it up to 1750 Hz. With few lines, evenly spread over the logarithm of
frequency, the noise at each line is small. The sizes of the lines are half way between those that
give a flat plant input and those that give a flat motion of the lens.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import butter, sosfilt

from workbench import solve
from workbench.errors import SolverError
from workbench.identification import Multisine, RationalModelFit, schroeder_phases
from workbench.simulation import linear_controller
from workbench.types import ComplexArray, RealArray, StateSpace

from ...drive.disc import Disc
from ...drive.plants import controller
from ...drive.tables import Axis, red_book
from ..bench_setup import PERIOD, RATE
from ..experiment import Laboratory
from ..in_the_loop import DISC_SHARE, ERROR_SWING, LOOP_SETTLING, ROTATION, controller_response
from ..record import Record

SAMPLES = 4200
"""Number of samples in a period of the multisine; its lines are multiples of 8.3 Hz."""
BAND, LINES = (100.0, 3500.0), 40
"""Band [Hz] of the multisine and number of its lines."""
LARGEST_INPUT = 4.0
"""Peak [V] of the multisine, and of the part of u that it causes in the nominal loop. Noise adds
0.8 V rms to u of CD1 and 1.2 V to that of CD8; the converter's limit is 10 V.
"""
LOW_CUT = 60.0
"""Corner [Hz] of the high-pass filter that removes the effect of the turning disc from all signals.
"""
CONTROLLER_ORDER, CONTROLLER_ERROR = 3, 1e-3
"""Order, and largest accepted relative error, of the controller's model at a lower sampling rate.
"""


@dataclass(frozen=True, eq=False)
class LoopSignals:
    """Excitation r, input u and output y (N,) of the plant, sampled every `step` [s].

    period: number of samples in a period of r.
    """

    r: RealArray
    u: RealArray
    y: RealArray
    step: float
    period: int


@dataclass(frozen=True, eq=False)
class MultisineExperiment:
    """A multisine of several periods in the loop of a drive under the reference controller."""

    bench: Laboratory
    periods: int

    @cached_property
    def multisine(self) -> Multisine:
        """The multisine [V], scaled until it reaches one of the limits in the nominal loop.

        The limits are ERROR_SWING for the error and LARGEST_INPUT for the plant's input. Its phases
        are Schroeder's, either for the lens or for the input, whichever allows a larger multisine.
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
        """The excitation [V] (N,) after the loop has settled, and the record."""
        axis = self.bench.axis
        rest = np.zeros(round(LOOP_SETTLING * RATE))
        signal = np.append(rest, np.tile(self.multisine.period(), self.periods))
        disc = Disc.along(axis, DISC_SHARE * red_book(axis).deviation, rotation=ROTATION)
        law = linear_controller(controller(axis), PERIOD)
        return signal, self.bench.closed_loop(law, signal, disc=disc, seed=seed)


def signals(excitation: RealArray, record: Record, every: int) -> LoopSignals:
    """Every `every`-th sample of r, u and f_en, with the same high-pass filter and without the
    first period.

    There is no anti-aliasing filter. Nothing is excited above half the lower rate, aliased noise is
    still noise, and such a filter would make u depend on later samples of y.
    """
    high = butter(2, LOW_CUT, "highpass", fs=RATE, output="sos")
    settled = round(LOOP_SETTLING * RATE) + SAMPLES
    r, u, y = (sosfilt(high, one)[settled::every] for one in (excitation, record.u, record.f_en))
    return LoopSignals(r, u, y, every * PERIOD, SAMPLES // every)


def sampled_controller(axis: Axis, every: int) -> StateSpace:
    """The controller from f_en to -u, as it acts between samples that are `every` times as long.

    It is fitted to the known response in the band of the multisine. A controller that is
    discretised anew at the lower rate would differ from it at high frequencies.
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
    """Largest magnitude within a period of a multisine with complex amplitudes."""
    one = Multisine(lines, abs(amplitudes), np.angle(amplitudes), SAMPLES)
    return float(abs(one.period()).max())
