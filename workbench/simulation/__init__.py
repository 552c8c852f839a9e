"""Sampled-data loops: exact discretisation, converters, noise, and any controller in the loop."""

from workbench.simulation.controllers import Controller, idle, linear
from workbench.simulation.converters import Converter
from workbench.simulation.discretise import hold, respond, sampled
from workbench.simulation.loop import SampledLoop, Trajectory
from workbench.simulation.noise import band_limited
from workbench.simulation.play import play

__all__ = [
    "Controller",
    "Converter",
    "SampledLoop",
    "Trajectory",
    "band_limited",
    "hold",
    "idle",
    "linear",
    "play",
    "respond",
    "sampled",
]
