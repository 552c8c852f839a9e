"""Realisations without states that no input reaches or no output shows."""

from __future__ import annotations

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.systems.balancing import balanced
from workbench.systems.frequency_response import frequency_response
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import EPS, realisation
from workbench.systems.standard_plant import standard_plant

STAIRCASE = (1e-7, 1e-9, 1e-11, 1e-13)
"""Tolerances of the staircase, the first of which that keeps the response is taken."""

KEPT = 1e-9
"""Largest change of the response that a reduction may make, relative to its largest entry."""

SAME = 1e-6
"""Distance up to which a hidden mode is the copy of another one, relative to the largest."""

ROUNDING = 100.0
"""Multiple of the rounding error of a matrix up to which a value counts as zero."""


def minimal(
    A: RealArray, B: RealArray, C: RealArray, dt: float = 0.0
) -> tuple[RealArray, RealArray, RealArray]:
    """A realisation without states that no input reaches or no output shows.

    The response stays the same. Unstable states may go where they are copies of ones that remain,
    as when a system stands in a connection twice.

    Raises
    ------
    InputError
        An unstable hidden mode that is no copy.
    """
    from slycot import tb01pd

    n = len(A)
    if n == 0:
        return A, B, C
    modes = np.linalg.eigvals(A).astype(complex)
    for tolerance in STAIRCASE:
        # SLICOT works in the arrays that it is given.
        width = max(B.shape[1], len(C))
        wide, tall = np.zeros((n, width)), np.zeros((width, n))
        wide[:, : B.shape[1]], tall[: len(C)] = B, C
        a, b, c, r = tb01pd(
            n, B.shape[1], len(C), A.copy(), wide, tall, job="M", equil="N", tol=tolerance
        )
        if r == n:
            return A, B, C
        small = a[:r, :r], b[:r, : B.shape[1]], c[: len(C), :r]
        if _same((A, B, C), small, modes):
            _check_hidden(_unstable(A, dt), small[0])
            return small
    return A, B, C


def visible(plant: GeneralisedPlant) -> GeneralisedPlant:
    """The plant without hidden unstable copies of states; as it is where there are none.

    Raises InputError as `minimal` and `standard_plant`.
    """
    given = standard_plant(plant)
    A, B, C = minimal(*balanced(given.A, given.B, given.C), given.dt)
    if len(_unstable(A, given.dt)) == len(_unstable(given.A, given.dt)):
        return plant
    system = plant.system
    labels = {"inputs": system.input_labels, "outputs": system.output_labels}
    reduced = realisation((A, B, C, given.D), given.dt, **labels)
    return GeneralisedPlant(reduced, plant.structure, plant.controls, plant.measurements)


def _same(
    one: tuple[RealArray, RealArray, RealArray],
    other: tuple[RealArray, RealArray, RealArray],
    modes: ComplexArray,
) -> bool:
    """Whether realisations agree on a half circle about each mode."""
    size = np.abs(modes)
    radius = np.unique(np.maximum(size, 1e-8 * size.max() + np.finfo(float).tiny))
    radius = np.geomspace(radius[0] / 3, radius[-1] * 3, 12)
    points = np.concatenate([radius * np.exp(0.5j), radius * np.exp(2.0j)])

    def value(A: RealArray, B: RealArray, C: RealArray) -> RealArray:
        D = np.zeros((len(C), B.shape[1]))
        return frequency_response(np.block([[A, B], [C, D]]), len(A), points)

    expected = value(*one)
    # Each entry is judged against the largest of its input and of its output.
    size = np.abs(expected)
    scale = np.sqrt(size.max(axis=-1, keepdims=True) * size.max(axis=-2, keepdims=True))
    return bool((np.abs(value(*other) - expected) <= KEPT * scale).all())


def _unstable(A: RealArray, dt: float) -> ComplexArray:
    """Modes on the stability boundary, by rounding, or beyond it."""
    modes = np.linalg.eigvals(A).astype(complex)
    rounding = ROUNDING * EPS * len(A) * float(np.linalg.norm(A))
    return modes[(np.abs(modes) - 1.0 if dt else modes.real) >= -rounding]


def _check_hidden(unstable: ComplexArray, left: RealArray) -> None:
    """Raise InputError for an unstable mode of which no copy is left."""
    modes = np.linalg.eigvals(left).astype(complex)
    for mode in unstable:
        # Modes that coincide are known to the root of the rounding error.
        if not (np.abs(modes - mode) <= SAME * np.abs(modes).max(initial=0.0)).any():
            raise InputError(
                f"the plant has the unstable mode {mode:.6g}, which no input reaches or no output "
                "shows, so that nothing can stabilise it; take it out of the plant"
            )
