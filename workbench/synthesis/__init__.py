"""Synthesis: H-infinity and mu controllers, every loop certified."""

from workbench.synthesis import dk, hinf_conic, hinf_methods
from workbench.synthesis.assumptions import regularised
from workbench.synthesis.hinf import HinfController, HinfSynthesis, hinf
from workbench.synthesis.loop_shaping import LoopShaping
from workbench.synthesis.mixed_sensitivity import MixedSensitivity
from workbench.synthesis.mu_synthesis import Iterate, MuController, MuSynthesis

__all__ = [
    "HinfController",
    "HinfSynthesis",
    "Iterate",
    "LoopShaping",
    "MixedSensitivity",
    "MuController",
    "MuSynthesis",
    "dk",
    "hinf",
    "hinf_conic",
    "hinf_methods",
    "regularised",
]
