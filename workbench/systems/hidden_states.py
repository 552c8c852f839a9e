"""Minimal realisations: uncontrollable and unobservable states removed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench._core.arrays import EPS, BoolArray, ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.solvers import slicot_routine
from workbench.systems.axis_poles import irreducible_parts, shown_apart
from workbench.systems.balancing import balanced, speed
from workbench.systems.frequency_response import frequency_response
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import realisation
from workbench.systems.standard_plant import standard_plant

STAIRCASE_TOLERANCES = (1e-7, 1e-9, 1e-11, 1e-13)
"""Tolerances of the staircase reduction; the first one that keeps the response is used."""

RESPONSE_TOLERANCE = 1e-9
"""Largest change of a response that a reduction may cause, relative to its largest entry."""

COPY_TOLERANCE = 1e-6
"""A hidden mode counts as a copy of another mode up to this distance, relative to the largest
mode.
"""

ZERO_ROUNDING = 100.0
"""A value computed from a matrix counts as zero up to this multiple of the matrix's rounding
error.
"""


def seen_states(M: RealArray, n: int) -> BoolArray:
    """Marks the states of M = [A B; C D] that lie between inputs and outputs, by M's zeros."""
    A = M[:n, :n] != 0.0
    reached, reaching = (M[:n, n:] != 0.0).any(axis=1), (M[n:, :n] != 0.0).any(axis=0)
    for _ in range(n):
        reached, reaching = reached | A[:, reached].any(axis=1), reaching | A[reaching].any(axis=0)
    seen: BoolArray = reached & reaching
    return seen


def visible_matrices(
    A: RealArray, B: RealArray, C: RealArray, dt: float = 0.0
) -> tuple[RealArray, RealArray, RealArray]:
    """Remove the uncontrollable and unobservable states of a realisation.

    The response stays the same. An unstable hidden state may be removed only if it is a copy of a
    remaining state, as when a system occurs twice in a connection.

    Raises
    ------
    InputError
        A hidden unstable mode is not a copy of a remaining mode, or an entry is not finite.
    """
    if not all(np.isfinite(part).all() for part in (A, B, C)):
        raise InputError("the realisation's sizes go beyond doubles: take another unit of time")
    tb01pd = slicot_routine("tb01pd")

    n = len(A)
    if n == 0:
        return A, B, C
    modes = np.linalg.eigvals(A).astype(complex)
    for tolerance in STAIRCASE_TOLERANCES:
        # SLICOT overwrites its arguments.
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
            _check_hidden(unstable_modes(A, dt), small[0])
            return small
    return A, B, C


def visible(plant: GeneralisedPlant) -> GeneralisedPlant:
    """Remove a plant's hidden unstable copies of states; without any, return it unchanged.

    Raises InputError as `visible_matrices` and `standard_plant` do.
    """
    given = standard_plant(plant)
    A, B, C = visible_matrices(*balanced(given.A, given.B, given.C), given.dt)
    if len(unstable_modes(A, given.dt)) == len(unstable_modes(given.A, given.dt)):
        return plant
    system = plant.system
    labels = {"inputs": system.input_labels, "outputs": system.output_labels}
    reduced = realisation((A, B, C, given.D), given.dt, **labels)
    return replace(plant, system=reduced)


def without_hidden_states(system: StateSpace) -> StateSpace:
    """The system without states that no input reaches or no output sees, by python-control.

    Time and states are scaled first, because the tolerance is absolute.
    """
    import control

    if not system.nstates:
        return system
    rate = speed(system.A, system.B, system.C)
    parts = balanced(system.A / rate, system.B / rate, system.C)
    slow = control.minreal(control.ss(*parts, system.D, system.dt), verbose=False)
    if slow.nstates == system.nstates:
        return system
    return control.ss(slow.A * rate, slow.B * rate, slow.C, slow.D, system.dt)


def _same(
    one: tuple[RealArray, RealArray, RealArray],
    other: tuple[RealArray, RealArray, RealArray],
    modes: ComplexArray,
) -> bool:
    """Whether two realisations have equal responses at points whose sizes are near those of the
    modes.
    """
    size = np.abs(modes)
    radius = np.unique(np.maximum(size, 1e-8 * float(size.max()) or 1.0))
    radius = np.geomspace(radius[0] / 3, radius[-1] * 3, 12)
    points = np.concatenate([radius * np.exp(0.5j), radius * np.exp(2.0j)])

    def value(A: RealArray, B: RealArray, C: RealArray) -> RealArray:
        D = np.zeros((len(C), B.shape[1]))
        return frequency_response(np.block([[A, B], [C, D]]), len(A), points)

    expected = value(*one)
    # Each entry is compared with the largest entries of its input and of its output.
    size = np.abs(expected)
    scale = np.sqrt(size.max(axis=-1, keepdims=True) * size.max(axis=-2, keepdims=True))
    return bool((np.abs(value(*other) - expected) <= RESPONSE_TOLERANCE * scale).all())


def unstable_modes(A: RealArray, dt: float) -> ComplexArray:
    """Modes beyond the stability boundary, or on it up to rounding.

    States that do not influence each other in a circle are separated, so that the modes of slow
    ones are as accurate as their own entries.
    """
    blocks = [A[np.ix_(part, part)] for part in irreducible_parts(A)]
    modes = np.concatenate([np.zeros(0, complex), *map(np.linalg.eigvals, blocks)])
    rounding = ZERO_ROUNDING * EPS * len(A) * float(np.linalg.norm(A))
    modes = modes[(np.abs(modes) - 1.0 if dt else modes.real) >= -rounding]
    inside = np.abs(modes) < 1.0 if dt else modes.real < 0.0
    points = modes / np.abs(modes) if dt else 1j * modes.imag
    return modes[~(inside & shown_apart(A, modes, points))]


def _check_hidden(unstable: ComplexArray, left: RealArray) -> None:
    """Raise InputError for an unstable mode of which no copy remains."""
    modes = np.linalg.eigvals(left).astype(complex)
    for mode in unstable:
        # Coinciding modes are accurate only to the square root of the rounding error.
        if not (np.abs(modes - mode) <= COPY_TOLERANCE * np.abs(modes).max(initial=0.0)).any():
            raise InputError(
                f"the plant has the unstable mode {mode:.6g}, which no input reaches or no output "
                "shows, so that nothing can stabilise it; take it out of the plant"
            )
