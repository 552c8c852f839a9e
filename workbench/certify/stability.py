"""Internal stability of a closed loop, by its poles."""

from __future__ import annotations

import numpy as np

from workbench.heavy_types import StateSpace
from workbench.program import Check


def stability_of(loop: StateSpace) -> Check:
    """Check that all poles of a loop are stable by more than their rounding error.

    Stable poles lie left of the imaginary axis in continuous time, within the unit circle in
    discrete time.
    """
    poles = loop.poles()
    size = float(np.abs(poles).max(initial=0.0))
    limits = np.finfo(float)
    # A pole at 0 is not stable, however small the others are.
    rounding = max(float(limits.eps) * max(len(poles), 1) * size, float(limits.tiny))
    distance = np.abs(poles) - 1.0 if loop.dt else poles.real
    place = int(np.argmax(distance)) if len(poles) else 0
    value = float(distance[place]) if len(poles) else -np.inf
    where = f"at {poles[place]:.6g}" if len(poles) else ""
    statement = "distance of the worst closed-loop pole beyond the stability boundary"
    return Check("internal stability", statement, value, -rounding, where)
