"""Synthesis: H-infinity and mu controllers, certified, reduced, discretised, exported.

Takes: a generalised plant, perhaps with uncertainty; the order or family of the controller.
Gives: a controller with its certified norm or peak of mu, and C code of it.
Rests on: two Riccati equations or linear matrix inequalities (H-infinity, H2); D-K iteration and
    nonsmooth descent, which end in local optima; duality for bounds that no controller can beat.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import on_demand

if TYPE_CHECKING:
    from workbench.synthesis.demands.bandwidth_limits import BandwidthLimits
    from workbench.synthesis.demands.channels import channel_plant, demanded_channels
    from workbench.synthesis.demands.demand_conflict import DemandConflict
    from workbench.synthesis.demands.demands import Demands
    from workbench.synthesis.demands.weighted_loop import demanded_plant
    from workbench.synthesis.designs import DESIGNS, DesignTask
    from workbench.synthesis.families.decentralised import Decentralised
    from workbench.synthesis.families.family import Family
    from workbench.synthesis.families.lead_lag import LeadLag
    from workbench.synthesis.families.modal import Modal, Static
    from workbench.synthesis.families.observer import ObserverForm
    from workbench.synthesis.families.parametrised import Parametrised
    from workbench.synthesis.families.sparse import Sparse
    from workbench.synthesis.families.three_terms import PD, PI, PID
    from workbench.synthesis.h2.lqg import lqg
    from workbench.synthesis.h2.program import H2Controller, H2Synthesis
    from workbench.synthesis.h_infinity.gap_metric import gap_metric
    from workbench.synthesis.h_infinity.hinf import hinf
    from workbench.synthesis.h_infinity.known_disturbance import (
        DisturbanceBound,
        known_disturbance_bound,
    )
    from workbench.synthesis.h_infinity.loop_shaping import LoopShaping
    from workbench.synthesis.h_infinity.mixed_sensitivity import MixedSensitivity
    from workbench.synthesis.h_infinity.program import HinfController, HinfSynthesis
    from workbench.synthesis.h_infinity.singular_plants.regularised import regularise
    from workbench.synthesis.implementation.aliases import SampledRobustness, sampled_robustness
    from workbench.synthesis.implementation.approximation import (
        ReductionMethod,
        approximate,
        approximations,
    )
    from workbench.synthesis.implementation.continuation import continuous_controller
    from workbench.synthesis.implementation.discretise import discretise
    from workbench.synthesis.implementation.export import export, load_controller
    from workbench.synthesis.implementation.fixed_point import FixedCascade, FixedPoint, fixed_point
    from workbench.synthesis.implementation.implemented import ImplementedController, Precision
    from workbench.synthesis.implementation.program import Implementation
    from workbench.synthesis.implementation.reduced import ReducedController, ReducedControllers
    from workbench.synthesis.implementation.reduction import reduce_order
    from workbench.synthesis.implementation.sampled_loop import (
        SampledConditions,
        SampledMargins,
        sampled_conditions,
    )
    from workbench.synthesis.implementation.second_order import Sections, second_order_sections
    from workbench.synthesis.implementation.working_point.point import WorkingPoint
    from workbench.synthesis.limits.analytic_basis import AnalyticBasis
    from workbench.synthesis.limits.dual_bound import DualCertificate
    from workbench.synthesis.limits.dual_search import highest_certificate
    from workbench.synthesis.limits.least_mu import (
        LargestLeastMu,
        LargestLeastMuChecker,
        LeastMu,
        largest_least_mu,
        least_mu,
    )
    from workbench.synthesis.limits.loop_functions import LoopFunctions
    from workbench.synthesis.limits.loop_weights import LoopWeights
    from workbench.synthesis.mixed_norms.program import H2HinfController, H2HinfSynthesis
    from workbench.synthesis.mu.control_cover import ControlCover, CoverPart
    from workbench.synthesis.mu.demand_cost import DemandCost
    from workbench.synthesis.mu.equalising_gain import equalising_gain
    from workbench.synthesis.mu.mu_controller import MuController
    from workbench.synthesis.mu.program import PEAK_TOLERANCE, MuSynthesis
    from workbench.synthesis.mu.rounds import Iterate
    from workbench.synthesis.mu.structured.norm.branching import least_norm_in_box
    from workbench.synthesis.mu.structured.norm.gain_box import GainBoxBound
    from workbench.synthesis.operation.kept_demands import KeptDemands
    from workbench.synthesis.operation.setpoint_filter import setpoint_time_constant
    from workbench.synthesis.operation.working_loop import WorkingLoop
    from workbench.synthesis.records.inequalities import FeedbackCriterion, ProvenFeedback
    from workbench.synthesis.records.program import FeedbackFromRecords
    from workbench.synthesis.records.record import NoiseEnergy, StateRecords
    from workbench.synthesis.reduction.approximated_system import ApproximatedSystem
    from workbench.synthesis.switching.boxes import SwitchedBox, proven_share
    from workbench.synthesis.switching.controllers import (
        dropout_modes,
        filtering_modes,
        replacement_modes,
        unswitched_modes,
    )
    from workbench.synthesis.switching.deviations import Deviations
    from workbench.synthesis.switching.loops import (
        SampledPlant,
        SwitchedLoop,
        closed_loop_transition,
        switched_loop,
    )
    from workbench.synthesis.switching.modes import Mode
    from workbench.synthesis.switching.program import Dwell, SwitchedStability
    from workbench.synthesis.switching.single_loops import SAMPLINGS, MarginsOfPlants, SingleLoops
    from workbench.systems.weight import weight
else:
    __getattr__, __dir__ = on_demand(__name__)

__all__ = [
    "DESIGNS",
    "PD",
    "PEAK_TOLERANCE",
    "PI",
    "PID",
    "SAMPLINGS",
    "AnalyticBasis",
    "ApproximatedSystem",
    "BandwidthLimits",
    "ControlCover",
    "CoverPart",
    "Decentralised",
    "DemandConflict",
    "DemandCost",
    "Demands",
    "DesignTask",
    "Deviations",
    "DisturbanceBound",
    "DualCertificate",
    "Dwell",
    "Family",
    "FeedbackCriterion",
    "FeedbackFromRecords",
    "FixedCascade",
    "FixedPoint",
    "GainBoxBound",
    "H2Controller",
    "H2HinfController",
    "H2HinfSynthesis",
    "H2Synthesis",
    "HinfController",
    "HinfSynthesis",
    "Implementation",
    "ImplementedController",
    "Iterate",
    "KeptDemands",
    "LargestLeastMu",
    "LargestLeastMuChecker",
    "LeadLag",
    "LeastMu",
    "LoopFunctions",
    "LoopShaping",
    "LoopWeights",
    "MarginsOfPlants",
    "MixedSensitivity",
    "Modal",
    "Mode",
    "MuController",
    "MuSynthesis",
    "NoiseEnergy",
    "ObserverForm",
    "Parametrised",
    "Precision",
    "ProvenFeedback",
    "ReducedController",
    "ReducedControllers",
    "ReductionMethod",
    "SampledConditions",
    "SampledMargins",
    "SampledPlant",
    "SampledRobustness",
    "Sections",
    "SingleLoops",
    "Sparse",
    "StateRecords",
    "Static",
    "SwitchedBox",
    "SwitchedLoop",
    "SwitchedStability",
    "WorkingLoop",
    "WorkingPoint",
    "approximate",
    "approximations",
    "channel_plant",
    "closed_loop_transition",
    "continuous_controller",
    "demanded_channels",
    "demanded_plant",
    "discretise",
    "dropout_modes",
    "equalising_gain",
    "export",
    "filtering_modes",
    "fixed_point",
    "gap_metric",
    "highest_certificate",
    "hinf",
    "known_disturbance_bound",
    "largest_least_mu",
    "least_mu",
    "least_norm_in_box",
    "load_controller",
    "lqg",
    "proven_share",
    "reduce_order",
    "regularise",
    "replacement_modes",
    "sampled_conditions",
    "sampled_robustness",
    "second_order_sections",
    "setpoint_time_constant",
    "switched_loop",
    "unswitched_modes",
    "weight",
]
