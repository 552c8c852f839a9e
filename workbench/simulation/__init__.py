"""Sampled-data loops: discretisation, converters, noise, controllers and strategies, scores.

Takes: a plant, a controller in parts, disturbances, and when the parts are switched.
Gives: signals, sample by sample, and scores of ensembles with intervals.
Rests on: exact discretisation under a hold, and compiled loops.
"""

from typing import TYPE_CHECKING

from workbench._core.compiled import kernel
from workbench._core.on_demand import no_more_names
from workbench.simulation.cascade import Cascade, Part
from workbench.simulation.controllers import (
    Controller,
    discrete_system,
    linear_controller,
    zero_controller,
)
from workbench.simulation.converters import Converter
from workbench.simulation.ensemble_scores import (
    ErrorScores,
    balloon_size,
    bootstrap_weights,
    error_scores,
    group_means,
    percentile_interval,
)
from workbench.simulation.gain_control import automatic_gain_control
from workbench.simulation.loop import SampledLoop, Schedule, Trajectory
from workbench.simulation.noise import band_limited_noise
from workbench.simulation.play import play
from workbench.simulation.repetitive import Repetitive
from workbench.simulation.switching import (
    adder,
    blender,
    fault_subtractor,
    interval_gate,
    ramped_gain,
    tracking_controller,
)
from workbench.systems.sampling import held_input_matrices, respond, sampled_model

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = [
    "Cascade",
    "Controller",
    "Converter",
    "ErrorScores",
    "Part",
    "Repetitive",
    "SampledLoop",
    "Schedule",
    "Trajectory",
    "adder",
    "automatic_gain_control",
    "balloon_size",
    "band_limited_noise",
    "blender",
    "bootstrap_weights",
    "discrete_system",
    "error_scores",
    "fault_subtractor",
    "group_means",
    "held_input_matrices",
    "interval_gate",
    "kernel",
    "linear_controller",
    "percentile_interval",
    "play",
    "ramped_gain",
    "respond",
    "sampled_model",
    "tracking_controller",
    "zero_controller",
]
