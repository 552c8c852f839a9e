"""Sampled-data loops: discretisation, converters, noise, controllers and strategies, scores.

Takes: a plant, a controller in parts, disturbances, and when the parts are switched.
Gives: signals, sample by sample, and scores of ensembles with intervals.
Rests on: exact discretisation under a hold, and compiled loops.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import no_more_names
from workbench.simulation.cascade import Cascade, Part
from workbench.simulation.controllers import Controller, idle, in_discrete_time, linear
from workbench.simulation.converters import Converter
from workbench.simulation.ensemble_scores import (
    ErrorScores,
    balloon_size,
    bootstrap_weights,
    error_scores,
    group_means,
    percentile_interval,
)
from workbench.simulation.gain_control import wobbled_gain
from workbench.simulation.loop import SampledLoop, Schedule, Trajectory
from workbench.simulation.noise import band_limited
from workbench.simulation.play import play
from workbench.simulation.repetitive import Repetitive
from workbench.simulation.switching import blend, following, ramped, removed, silenced, total
from workbench.systems.sampling import continued, hold, respond, sampled

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
    "balloon_size",
    "band_limited",
    "blend",
    "bootstrap_weights",
    "continued",
    "error_scores",
    "following",
    "group_means",
    "hold",
    "idle",
    "in_discrete_time",
    "linear",
    "percentile_interval",
    "play",
    "ramped",
    "removed",
    "respond",
    "sampled",
    "silenced",
    "total",
    "wobbled_gain",
]
