"""The structured singular value: certified bounds at frequencies and over all of them."""

from workbench.mu import upper_ab13md, upper_conic, upper_fast
from workbench.mu.branch import branch_and_bound
from workbench.mu.destabilising import destabilising
from workbench.mu.gradient import gradient
from workbench.mu.lower import lower_bound
from workbench.mu.lower_program import LowerBound, MuLowerBound
from workbench.mu.margins import Conditions, conditions
from workbench.mu.peak import Peak, peak, regularised
from workbench.mu.sensitivity import sensitivity
from workbench.mu.skew import SkewBounds, skew_bounds
from workbench.mu.sweep import Sweep, sweep
from workbench.mu.upper import upper_bound
from workbench.mu.upper_program import MuUpperBound, UpperBound
from workbench.mu.worst_case import WorstCaseGain, worst_case_gain
from workbench.structure import Complex, Full, Real, Structure

__all__ = [
    "Complex",
    "Conditions",
    "Full",
    "LowerBound",
    "MuLowerBound",
    "MuUpperBound",
    "Peak",
    "Real",
    "SkewBounds",
    "Structure",
    "Sweep",
    "UpperBound",
    "WorstCaseGain",
    "branch_and_bound",
    "conditions",
    "destabilising",
    "gradient",
    "lower_bound",
    "peak",
    "regularised",
    "sensitivity",
    "skew_bounds",
    "sweep",
    "upper_ab13md",
    "upper_bound",
    "upper_conic",
    "upper_fast",
    "worst_case_gain",
]
