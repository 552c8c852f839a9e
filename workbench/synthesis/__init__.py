"""Synthesis: H-infinity and mu controllers, every loop certified."""

from workbench.synthesis import dk, fixed, hinf_conic, hinf_methods
from workbench.synthesis.assumptions import regularised
from workbench.synthesis.families import Family, Modal
from workbench.synthesis.hinf import HinfController, HinfSynthesis, hinf
from workbench.synthesis.loop_shaping import LoopShaping
from workbench.synthesis.mixed_sensitivity import MixedSensitivity
from workbench.synthesis.mu_synthesis import Iterate, MuController, MuSynthesis

__all__ = [
    "Family",
    "HinfController",
    "HinfSynthesis",
    "Iterate",
    "LoopShaping",
    "MixedSensitivity",
    "Modal",
    "MuController",
    "MuSynthesis",
    "dk",
    "fixed",
    "hinf",
    "hinf_conic",
    "hinf_methods",
    "regularised",
]
