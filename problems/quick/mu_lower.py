"""Lower bounds of mu of robust performance, at a few frequencies."""

from __future__ import annotations

from workbench import problem
from workbench.mu import MuLowerBound

from .loops import Few, Loop, loop_matrices


@problem("quick/{plant}/mu-lower", plant=("mass-spring", "distillation"))
def mu_lower(plant: Loop, frequencies: Few = 12) -> MuLowerBound:
    """Lower bound of mixed mu of a loop: the smallest perturbation found at each frequency.

    The loops are those of quick/{plant}/mu-upper.

    frequencies: number of frequencies.
    """
    return MuLowerBound(*loop_matrices(plant, frequencies))
