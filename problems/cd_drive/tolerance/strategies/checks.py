"""What must hold of the strategies: the order that the thesis found, and that the loops are stable.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import Check
from workbench.heavy_types import Dataset

SMALLER = {"A": 0.5, "B": 0.5, "C": 2 / 3, "K_prime": 2 / 3}
"""Share of the reference strategy's excursion that these may have: a much smaller one."""
SUPPRESSED = 0.1
"""Share of its periodic error that A and B may leave."""
EQUAL = 0.1
"""By how much that of C may differ: the same open loop (section 8.6)."""
REPLAYED = 0.05
"""By how much an excursion may change at half the step, relative."""


def checks_of(answer: Dataset) -> list[Check]:
    """Named checks of a study of one axis."""
    excursion = answer["excursion"] / answer["excursion"].sel(strategy="reference")
    periodic = answer["periodic"] / answer["periodic"].sel(strategy="reference")
    found = []
    for name, share in SMALLER.items():
        one = excursion.sel(strategy=name)
        statement = "largest excursion after the scratch over that of the reference strategy"
        found.append(_worst(f"excursion {name}", statement, one, share))
    for name in ("A", "B"):
        one = periodic.sel(strategy=name)
        statement = "largest periodic error over that of the reference strategy"
        found.append(_worst(f"periodic {name}", statement, one, SUPPRESSED))
    one = abs(periodic.sel(strategy="C") - 1.0)
    statement = "largest difference of the periodic error from the reference strategy's, relative"
    found.append(_worst("periodic C", statement, one, EQUAL))
    replayed = abs(answer["excursion_half_step"] / answer["excursion"].sel(drive="nominal") - 1.0)
    return [
        *found,
        Check(
            "kept",
            "times that focus or track was lost or regained, all drives",
            float(answer["events"].sel(strategy=["reference", *SMALLER]).sum()),
            0.0,
        ),
        _worst(
            "repetitive loop",
            "largest |Q (1 - g T)| of strategy A, 1 is the limit of the small gain theorem",
            answer["repetitive_level"],
            1.0 - 1e-6,
        ),
        _worst(
            "estimated loop",
            "growth of the slowest mode of strategy B [1/s]",
            -answer["estimated_decay"],
            0.0,
        ),
        Check(
            "half the step",
            "largest relative change of an excursion when the optics are followed twice as finely",
            float(replayed.max()),
            REPLAYED,
            f"at {replayed['strategy'].values[int(np.argmax(replayed.values))]}",
        ),
    ]


def _worst(name: str, statement: str, values: Any, limit: float) -> Check:
    at = int(np.argmax(values.values))
    return Check(name, statement, float(values[at]), limit, f"at {values['drive'].values[at]}")
