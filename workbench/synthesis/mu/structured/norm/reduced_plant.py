"""A plant with fewer states that stands for a large one in a search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.synthesis.reduction.kept_part import kept_and_stable
from workbench.systems.equations.gramians import balancing_projections, gramian_factors
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import Matrices, matrices_of, realisation

LARGE = 30
"""Number of states above which a plant is reduced."""
LEAST_SHARE = 1e-8
"""States are removed whose Hankel singular values are below this share of the largest one."""
WORTHWHILE = 0.7
"""Share of the states that a reduced plant has at most."""


def reduced_plant(plant: GeneralisedPlant) -> GeneralisedPlant | None:
    """The plant without states that hardly matter; None if too few can be removed.

    Balanced truncation of the part with stable poles, where each input and each output is scaled to
    unit energy, so that a weak channel counts as much as a strong one.
    """
    if plant.system.nstates <= LARGE:
        return None
    try:
        parts = kept_and_stable(matrices_of(plant.system))
        A, B, C, D = parts.stable
        left, right, values = balancing_projections(*_scaled_gramians(A, B, C))
    except InputError:
        return None
    count = int((values > LEAST_SHARE * values.max(initial=0.0)).sum())
    if parts.count + count > WORTHWHILE * plant.system.nstates:
        return None
    T, V = left[:count], right[:, :count]
    fewer: Matrices = parts.with_stable((T @ A @ V, T @ B, C @ V, D))
    return replace(plant, system=realisation(fewer, 0.0))


def _scaled_gramians(A: RealArray, B: RealArray, C: RealArray) -> tuple[RealArray, RealArray]:
    """Factors of the Gramians for outputs, and then inputs, scaled to unit energy."""
    S, _ = gramian_factors(A, B, C)
    C = C / _nonzero(np.linalg.norm(C @ S, axis=1))[:, None]
    _, R = gramian_factors(A, B, C)
    B = B / _nonzero(np.linalg.norm(R @ B, axis=0))
    return gramian_factors(A, B, C)


def _nonzero(sizes: RealArray) -> RealArray:
    """Sizes, with 1 for those that are zero."""
    return np.where(sizes > 0, sizes, 1.0)
