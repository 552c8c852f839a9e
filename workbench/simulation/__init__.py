"""Sampled-data loops: exact discretisation, converters, noise, any controller or strategy in it."""

from workbench.simulation.cascade import Cascade, Part
from workbench.simulation.controllers import Controller, idle, in_discrete_time, linear
from workbench.simulation.converters import Converter
from workbench.simulation.loop import SampledLoop, Schedule, Trajectory
from workbench.simulation.noise import band_limited
from workbench.simulation.play import play
from workbench.simulation.repetitive import Repetitive
from workbench.simulation.switching import blend, following, removed, silenced, total
from workbench.systems.sampling import continued, hold, respond, sampled

__all__ = [
    "Cascade",
    "Controller",
    "Converter",
    "Part",
    "Repetitive",
    "SampledLoop",
    "Schedule",
    "Trajectory",
    "band_limited",
    "blend",
    "continued",
    "following",
    "hold",
    "idle",
    "in_discrete_time",
    "linear",
    "play",
    "removed",
    "respond",
    "sampled",
    "silenced",
    "total",
]
