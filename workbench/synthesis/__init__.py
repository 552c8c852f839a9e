"""Synthesis: H-infinity and mu controllers, certified, reduced, discretised, exported."""

from workbench.synthesis import dgk, dk, fixed, hinf_conic, hinf_methods, switching_conic
from workbench.synthesis.assumptions import regularised
from workbench.synthesis.discretise import discretised
from workbench.synthesis.export import export, load
from workbench.synthesis.families import Family, Modal
from workbench.synthesis.fixed_point import FixedCascade, FixedPoint, fixed_point
from workbench.synthesis.hinf import HinfController, HinfSynthesis, hinf
from workbench.synthesis.known_disturbance import known_disturbance_bound
from workbench.synthesis.loop_shaping import LoopShaping
from workbench.synthesis.mixed_sensitivity import MixedSensitivity
from workbench.synthesis.mu_synthesis import MuController, MuSynthesis
from workbench.synthesis.reduction import Reduced, Reduction, reduce, reduced
from workbench.synthesis.rounds import Iterate
from workbench.synthesis.sampled_loop import Margins, SampledConditions, sampled_conditions
from workbench.synthesis.second_order import Sections, second_order_sections
from workbench.synthesis.structured import PID, Decentralised, LeadLag
from workbench.synthesis.switching import Dwell, Mode, SwitchedStability

__all__ = [
    "PID",
    "Decentralised",
    "Dwell",
    "Family",
    "FixedCascade",
    "FixedPoint",
    "HinfController",
    "HinfSynthesis",
    "Iterate",
    "LeadLag",
    "LoopShaping",
    "Margins",
    "MixedSensitivity",
    "Modal",
    "Mode",
    "MuController",
    "MuSynthesis",
    "Reduced",
    "Reduction",
    "SampledConditions",
    "Sections",
    "SwitchedStability",
    "dgk",
    "discretised",
    "dk",
    "export",
    "fixed",
    "fixed_point",
    "hinf",
    "hinf_conic",
    "hinf_methods",
    "known_disturbance_bound",
    "load",
    "reduce",
    "reduced",
    "regularised",
    "sampled_conditions",
    "second_order_sections",
    "switching_conic",
]
