"""H-infinity synthesis: controllers that are optimal in the worst case, and certified."""

from workbench.synthesis import hinf_conic, hinf_methods
from workbench.synthesis.assumptions import regularised
from workbench.synthesis.hinf import HinfController, HinfSynthesis, hinf

__all__ = ["HinfController", "HinfSynthesis", "hinf", "hinf_conic", "hinf_methods", "regularised"]
