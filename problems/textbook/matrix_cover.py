"""A plant of two inputs and two outputs with scattered parameters, covered by one matrix Delta."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from workbench import problem
from workbench.types import StateSpace
from workbench.uncertainty import MatrixCover, MatrixForm, MatrixResponses, WeightShape

BAND = (0.05, 100.0)
"""First and last frequency [rad/s]."""


class TwoByTwo(NamedTuple):
    """Parameters of the plant.

    The diagonal holds two resonances of natural frequency `w` [rad/s], damping ratio `z` and gain
    1. The off-diagonal entries are two lags of gain `k` and time constant `t` [s].
    """

    w: tuple[float, float]
    z: tuple[float, float]
    k: tuple[float, float]
    t: tuple[float, float]

    @property
    def system(self) -> StateSpace:
        """The plant as a system."""
        import control

        s = control.tf("s")
        first, second = (
            w**2 / (s**2 + 2 * z * w * s + w**2) for w, z in zip(self.w, self.z, strict=True)
        )
        upper, lower = (k / (t * s + 1) for k, t in zip(self.k, self.t, strict=True))
        return control.ss(control.combine_tf([[first, upper], [lower, second]]))


NOMINAL = TwoByTwo((5.0, 1.0), (0.4, 0.6), (3.0, 10.0), (0.1, 0.5))
"""Parameters of the example in the package dkpy (MIT licence), github.com/decargroup/dkpy."""
SPREAD = TwoByTwo((0.2, 0.2), (0.2, 0.2), (0.05, 0.05), (0.25, 0.25))
"""Largest relative change of each parameter."""


def scattered(count: int, rng: np.random.Generator) -> list[StateSpace]:
    """This many plants, with parameters drawn uniformly around the nominal ones."""
    found = []
    for _ in range(count):
        factors = 1 + np.array(SPREAD) * rng.uniform(-1, 1, (len(SPREAD), 2))
        found.append(TwoByTwo(*(np.array(NOMINAL) * factors).tolist()).system)
    return found


@problem("two-by-two/matrix-cover", slow=True)
def matrix_cover(
    form: MatrixForm = "additive",
    left: WeightShape = "diagonal",
    right: WeightShape = "diagonal",
    order: Annotated[int, Field(ge=0, le=8)] = 4,
    plants: Annotated[int, Field(ge=1, le=200)] = 20,
    frequencies: Annotated[int, Field(ge=10, le=1000)] = 100,
) -> MatrixCover:
    """Weights on both sides of one Delta such that a model contains plants of two channels.

    form: where Delta acts. left, right: shapes of the weights, full, diagonal or scalar. order:
    number of poles of each channel of a weight. plants, frequencies: number of plants and of
    frequencies.
    """
    omega = np.geomspace(*BAND, frequencies)
    known = MatrixResponses.of_systems(scattered(plants, np.random.default_rng(0)), omega)
    return MatrixCover(
        known,
        NOMINAL.system,
        form=form,
        left=left,
        right=right,
        left_order=order,
        right_order=order,
    )
