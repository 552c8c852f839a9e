"""Upper bounds of mu of robust performance, at a few frequencies."""

from __future__ import annotations

from workbench import problem
from workbench.mu import MuUpperBound

from .loops import Few, Loop, loop_matrices


@problem("quick/{plant}/mu-upper", plant=("mass-spring", "distillation"))
def mu_upper(plant: Loop, frequencies: Few = 12) -> MuUpperBound:
    """Upper bound of mixed mu of a loop: a D/G linear matrix inequality at each frequency.

    Besides the performance block, the two masses with a simple controller have a real and a complex
    scalar. The distillation column with an inverse-based controller has two complex scalars.

    frequencies: number of frequencies.
    """
    return MuUpperBound(*loop_matrices(plant, frequencies))
