"""Synthesis: H-infinity and mu controllers, certified, reduced, discretised, exported."""

from workbench.synthesis.hinf import conic as hinf_conic
from workbench.synthesis.hinf import methods as hinf_methods
from workbench.synthesis.hinf.assumptions import regularised
from workbench.synthesis.hinf.known_disturbance import known_disturbance_bound
from workbench.synthesis.hinf.loop_shaping import LoopShaping
from workbench.synthesis.hinf.mixed_sensitivity import MixedSensitivity
from workbench.synthesis.hinf.program import HinfController, HinfSynthesis, hinf
from workbench.synthesis.implementation.discretise import discretised
from workbench.synthesis.implementation.export import export, load_controller
from workbench.synthesis.implementation.fixed_point import FixedCascade, FixedPoint, fixed_point
from workbench.synthesis.implementation.reduction import (
    ReducedController,
    ReducedControllers,
    approximated,
    reduce_order,
)
from workbench.synthesis.implementation.sampled_loop import (
    Margins,
    SampledConditions,
    sampled_conditions,
)
from workbench.synthesis.implementation.second_order import Sections, second_order_sections
from workbench.synthesis.mu import dk
from workbench.synthesis.mu.families import Family, Modal
from workbench.synthesis.mu.multipliers import dgk
from workbench.synthesis.mu.program import MuController, MuSynthesis
from workbench.synthesis.mu.rounds import Iterate
from workbench.synthesis.mu.structured import fixed
from workbench.synthesis.mu.structured.named_families import PID, Decentralised, LeadLag
from workbench.synthesis.switching import conic as switching_conic
from workbench.synthesis.switching.program import Dwell, Mode, SwitchedStability

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
    "ReducedController",
    "ReducedControllers",
    "SampledConditions",
    "Sections",
    "SwitchedStability",
    "approximated",
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
    "load_controller",
    "reduce_order",
    "regularised",
    "sampled_conditions",
    "second_order_sections",
    "switching_conic",
]
