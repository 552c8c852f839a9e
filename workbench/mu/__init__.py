"""The structured singular value and margins of loops, bounded at and between frequencies.

Takes: complex matrices, systems and uncertain systems.
Gives: upper bounds with multipliers, lower bounds with perturbations, margins, worst cases.
Rests on: D and G scalings, a convex upper bound of mixed mu; a Hamiltonian matrix that carries a
    bound over an interval of frequency; branch and bound over real parameters.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import on_demand

if TYPE_CHECKING:
    from workbench.mu.boxes.probability import GuaranteedProbability, guaranteed_probability
    from workbench.mu.frequency.axis_norm import linf_norm
    from workbench.mu.frequency.complex_part import complex_part_added
    from workbench.mu.frequency.norms import SystemNorm, h2_norm, h_infinity_norm
    from workbench.mu.frequency.peak import peak
    from workbench.mu.frequency.peak_bounds import Peak, PeakChecker
    from workbench.mu.frequency.sweep import Sweep, frequency_sweep
    from workbench.mu.lower.bound import lower_bound
    from workbench.mu.lower.program import LowerBound, MuLowerBound
    from workbench.mu.margins.classical import ClassicalMargins
    from workbench.mu.margins.disk import DiskMargin, disk_gain, disk_phase
    from workbench.mu.margins.gap import CoprimeMargin, NuGap, coprime_margin, nu_gap
    from workbench.mu.margins.loop import loop_margins
    from workbench.mu.margins.measured import MeasuredMargins
    from workbench.mu.margins.of_sets import SetMargins
    from workbench.mu.margins.result import LoopMargins
    from workbench.mu.members.bundle import bundle_plot
    from workbench.mu.members.monte_carlo import MonteCarlo, monte_carlo
    from workbench.mu.robust.branch import branch_and_bound
    from workbench.mu.robust.conditions import Conditions, condition_systems, conditions
    from workbench.mu.robust.destabilising import destabilising_perturbation
    from workbench.mu.robust.element_sensitivity import MarginSensitivity, margin_sensitivity
    from workbench.mu.robust.gain_room import GainRoom, RoomChecker, gain_room
    from workbench.mu.robust.margin import robust_performance, robust_stability
    from workbench.mu.robust.margin_bounds import PerformanceMargin, StabilityMargin
    from workbench.mu.robust.performance import performance_peak, performance_sweep
    from workbench.mu.robust.rank_one import RankOneLoop, rank_one_mu
    from workbench.mu.robust.sensitivity import bound_sensitivity
    from workbench.mu.robust.skew import SkewBounds, skew_bounds
    from workbench.mu.robust.skewed_bounds import SkewedPeak, WorstCaseChecker, WorstCaseGain
    from workbench.mu.robust.skewed_peak import skewed_peak
    from workbench.mu.robust.worst_case import worst_case_gain
    from workbench.mu.upper.bound import upper_bound
    from workbench.mu.upper.gradient import bound_gradient
    from workbench.mu.upper.program import MuUpperBound, UpperBound
    from workbench.structure import Complex, Full, Real, Structure
else:
    __getattr__, __dir__ = on_demand(__name__)

__all__ = [
    "ClassicalMargins",
    "Complex",
    "Conditions",
    "CoprimeMargin",
    "DiskMargin",
    "Full",
    "GainRoom",
    "GuaranteedProbability",
    "LoopMargins",
    "LowerBound",
    "MarginSensitivity",
    "MeasuredMargins",
    "MonteCarlo",
    "MuLowerBound",
    "MuUpperBound",
    "NuGap",
    "Peak",
    "PeakChecker",
    "PerformanceMargin",
    "RankOneLoop",
    "Real",
    "RoomChecker",
    "SetMargins",
    "SkewBounds",
    "SkewedPeak",
    "StabilityMargin",
    "Structure",
    "Sweep",
    "SystemNorm",
    "UpperBound",
    "WorstCaseChecker",
    "WorstCaseGain",
    "bound_gradient",
    "bound_sensitivity",
    "branch_and_bound",
    "bundle_plot",
    "complex_part_added",
    "condition_systems",
    "conditions",
    "coprime_margin",
    "destabilising_perturbation",
    "disk_gain",
    "disk_phase",
    "frequency_sweep",
    "gain_room",
    "guaranteed_probability",
    "h2_norm",
    "h_infinity_norm",
    "linf_norm",
    "loop_margins",
    "lower_bound",
    "margin_sensitivity",
    "monte_carlo",
    "nu_gap",
    "peak",
    "performance_peak",
    "performance_sweep",
    "rank_one_mu",
    "robust_performance",
    "robust_stability",
    "skew_bounds",
    "skewed_peak",
    "upper_bound",
    "worst_case_gain",
]
