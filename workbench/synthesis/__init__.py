"""H-infinity synthesis: controllers that are optimal in the worst case, and certified."""

from workbench.synthesis import hinf_conic, hinf_methods
from workbench.synthesis.assumptions import regularised
from workbench.synthesis.hinf import HinfController, HinfSynthesis, hinf
from workbench.synthesis.loop_shaping import LoopShaping
from workbench.synthesis.mixed_sensitivity import MixedSensitivity

__all__ = [
    "HinfController",
    "HinfSynthesis",
    "LoopShaping",
    "MixedSensitivity",
    "hinf",
    "hinf_conic",
    "hinf_methods",
    "regularised",
]
