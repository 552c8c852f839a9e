"""The trusted code: it decides whether an answer holds, and does nothing else.

Takes: an answer and the data of its problem.
Gives: bounds rounded outward, and proofs that a stored answer carries with it.
Rests on: bounds of rounding errors, discs that enclose all eigenvalues, ball arithmetic, and
    Hamiltonian matrices, which carry a bound from one frequency to an interval.
"""

# It imports only the basic modules and `workbench.systems`. Methods and checks import this package;
# it imports no method.

from typing import TYPE_CHECKING

from workbench._core.on_demand import on_demand

if TYPE_CHECKING:
    from workbench.certify.norms import certified_norm
    from workbench.certify.stability import stability_check
else:
    __getattr__, __dir__ = on_demand(__name__)

__all__ = ["certified_norm", "stability_check"]
