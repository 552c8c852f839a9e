"""One experiment: a sine is added in the loop, and the sensitivity is measured from it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from workbench.identification import periodic_response
from workbench.systems import loop_response
from workbench.types import ComplexArray, RealArray

from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD
from ...laboratory.experiment import Laboratory
from ...laboratory.in_the_loop import (
    LoopExperiment,
    amplitudes,
    controller_response,
    noise_colour,
)
from ...laboratory.known_values import CONFIDENCE
from ...laboratory.unknowns import Told, corner_ratio
from ..loops import open_loop, plants

DWELL = 0.5
"""Least time at each frequency [s]; high frequencies are averaged for as long as low ones."""
COLOUR_STEPS = 7
"""Number of neighbouring frequencies over which the colour of the noise is averaged."""


class Measurement(NamedTuple):
    """Sensitivity measured in one record.

    S (F,): measured sensitivity. radius (F,): of the region that holds the true one with
    `CONFIDENCE`. model (F,): sensitivity of the sampled loop, from the told values of the bench.
    events: number of times that the loop was lost or regained. saturated: share of the samples of u
    at the converter's limit.
    """

    S: ComplexArray
    radius: RealArray
    model: ComplexArray
    events: int
    saturated: float


def measured(experiment: LoopExperiment, seed: int) -> Measurement:
    """The sensitivity from one record: the sine's part in u, divided by the sine that was added.

    Both are known exactly inside the computer, so errors of gain, delay or filter have no effect. A
    sine e added before the controller K is equivalent to the sine K e added behind it, as here; and
    the ratio of its part in the controller's input to e equals that of K e in u.
    """
    record = experiment.played(seed)
    w, u = amplitudes(np.stack([experiment.signal, record.u]), experiment.sine, True)
    estimate = periodic_response(experiment.frequency, w, u)
    colour = noise_colour(u - u.mean(axis=1, keepdims=True))
    colour = uniform_filter1d(colour, min(COLOUR_STEPS, len(colour)), mode="nearest")
    radius = estimate.radius(confidence=CONFIDENCE)[:, 0, 0] * np.sqrt(colour)
    told = Told.drawn(experiment.bench.axis, seed)
    return Measurement(
        estimate.response[:, 0, 0],
        radius,
        sampled_sensitivity(experiment, told),
        len(record.events),
        record.saturation["u"],
    )


def sampled_sensitivity(experiment: LoopExperiment, told: Told | None = None) -> ComplexArray:
    """Sensitivity (F,) of the sampled loop, exact or from the told values of the bench."""
    bench, frequency = experiment.bench, experiment.frequency
    plant = -bench.response(frequency)["f_en"]
    if told is not None:
        s = 2j * np.pi * frequency
        plant = plant * told.gain * np.exp(-s * PERIOD * told.delay)
        plant = plant * corner_ratio(told.error_corner, s)
    found: ComplexArray = 1 / (
        1 + experiment.scale * plant * controller_response(bench.axis, frequency)
    )
    return found


def continuous_sensitivity(axis: Axis, drive: str, frequency: RealArray, scale: float) -> RealArray:
    """|S| (F,) of a drive's loop in continuous time, without delay, as the thesis simulates it."""
    loop = open_loop(axis, plants(axis, "own", "printed")[drive])
    found: RealArray = np.abs(1 / (1 + scale * loop_response(loop, frequency)))
    return found


def experiment_on(
    axis: Axis, drive: str, frequency: RealArray, deviation: float, scale: float
) -> LoopExperiment:
    """The experiment on a drive, with a disc and a factor on the controller's gain."""
    return LoopExperiment(Laboratory(axis, drive), frequency, True, deviation, scale, DWELL)
