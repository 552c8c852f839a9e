"""The D step of D-K iteration: scalings for the loop of a round, one function for each block."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.mu import UpperBound
from workbench.structure import Structure
from workbench.synthesis.mu.biquads import Biquads
from workbench.synthesis.mu.scaling_fit import Fineness, Fitted, ScalingFit, worth
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response

REFERENCE_FLOOR = 0.5
"""Scalings need not follow the bound at frequencies where it is below this share of its peak."""


@dataclass(frozen=True, eq=False)
class LoopResponse:
    """The response ``M`` of a closed loop at frequencies ``omega`` (F,) [rad/s] from its poles.

    Unlike `FrequencyResponseData`, it chooses its frequencies from the poles of the loop.
    """

    omega: RealArray
    M: NDArray[Any]

    @classmethod
    def of(cls, system: StateSpace) -> LoopResponse:
        """The response of a stable closed loop."""
        omega = frequencies_of(system)
        return cls(omega, response(system, omega))


def d_step(
    structure: Structure,
    loop: LoopResponse,
    found: UpperBound,
    blocks: int,
    before: Fitted | None,
    fineness: Fineness,
) -> tuple[ScalingFit, Fitted, float]:
    """Scalings of the first `blocks` blocks with as few biquads as needed, their miss, and the
    data.

    ``found`` are the upper bounds of the loop. The miss is the logarithm of the worst ratio of
    sigma_max(D M D^-1) to the bound, or to `REFERENCE_FLOOR` times the peak of the bound where this
    is larger. The data to which the scalings are fitted are returned first.
    """
    bound, D = found.value, found.D_left
    reference = np.maximum(bound, REFERENCE_FLOOR * bound.max())
    first = [row.start for row in structure.column_slices]
    logs = np.log(np.diagonal(D, axis1=1, axis2=2).real[:, first]) / 2
    high = bound > 0.8 * bound.max()
    gains = np.median((logs[:, :blocks] - logs[:, blocks:]).T[:, high], axis=1)
    start = before or (Biquads(blocks, 0), gains[:, None])
    fit = ScalingFit.of(structure, loop.omega, loop.M, reference, fineness)
    return fit, *worth(fit, start)
