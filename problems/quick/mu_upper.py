"""Upper bounds of mu of robust performance, at a few frequencies."""

from __future__ import annotations

from workbench import problem
from workbench.mu import MuUpperBound

from .loops import Few, Loop, loop_matrices


@problem("quick/{plant}/mu-upper", plant=("mass-spring", "distillation"))
def mu_upper(plant: Loop, frequencies: Few = 12) -> MuUpperBound:
    """Upper bound of mixed mu of a loop: a D/G linear matrix inequality at each frequency.

    The two masses with a simple controller have a real and a complex scalar beside the performance,
    the distillation column with the inverse of its gains two complex scalars.

    frequencies: how many.
    """
    return MuUpperBound(*loop_matrices(plant, frequencies))
