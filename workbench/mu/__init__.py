"""The structured singular value: certified bounds at frequencies and over all of them."""

from workbench.mu import upper_ab13md, upper_conic, upper_fast
from workbench.mu.branch import branch_and_bound
from workbench.mu.gradient import gradient
from workbench.mu.lower import lower_bound
from workbench.mu.lower_program import LowerBound, MuLowerBound
from workbench.mu.margins import Conditions, conditions
from workbench.mu.peak import Peak, peak, regularised
from workbench.mu.sweep import Sweep, sweep
from workbench.mu.upper import upper_bound
from workbench.mu.upper_program import MuUpperBound, UpperBound

__all__ = [
    "Conditions",
    "LowerBound",
    "MuLowerBound",
    "MuUpperBound",
    "Peak",
    "Sweep",
    "UpperBound",
    "branch_and_bound",
    "conditions",
    "gradient",
    "lower_bound",
    "peak",
    "regularised",
    "sweep",
    "upper_ab13md",
    "upper_bound",
    "upper_conic",
    "upper_fast",
]
