"""Systems prepared for proofs: channels of like sizes, balanced states, continuous time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.stable_system import StableSystem, stable_system
from workbench.errors import InputError
from workbench.mu.upper.bound import upper_bound
from workbench.structure import Structure
from workbench.systems.balancing import speed
from workbench.systems.bilinear import bilinear_continuous
from workbench.systems.equations.gramians import balancing_projections, gramian_factors
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import realisation, worst_pole
from workbench.uncertainty.algebra.lft import INTEGRATOR
from workbench.uncertainty.algebra.reduction import without_channels
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain

SELF_ROUNDING = 1e-13
"""Gain of a channel to itself, without other loops, that may be mere rounding. A true loop with a
smaller gain is lost; it would matter only at 1e13 times its uncertainty. It is some hundred
roundings. Half or double moves this border.
"""
FREQUENCIES = 12
"""Largest number of frequencies at which the scalings of the channels are compared, about; their
median is taken as a power of two. With half of them it is less representative; double costs time.
"""


def balanced_coordinates(A: RealArray, B: RealArray, C: RealArray) -> RealArray | None:
    """States (n, n), as columns, in which the Gramians of a stable system are equal.

    Proofs on intervals of frequency need eigenvectors that are far from dependent. Those of chains
    of equal lags are nearly dependent; these coordinates are better. States that no channel sees
    come last. None where doubles do not find them.
    """
    rate = speed(A, B, C)
    try:
        left, right, _ = balancing_projections(*gramian_factors(A / rate, B / rate, C))
    except InputError:
        return None
    unseen = np.linalg.svd(left)[2][len(left) :].T if len(left) else np.eye(len(A))
    return np.hstack([right, unseen])


def even_channels(system: StateSpace, structure: Structure) -> tuple[StableSystem, float]:
    """A stable system in continuous time with channels of like sizes, and its period [s].

    The first channels belong to the structure. The outputs of each block are multiplied and its
    inputs divided by the same power of two, which changes no bound of mu and no perturbation. A
    sampled system is transformed by s = (2 / T) (z - 1) / (z + 1); a continuous one has the period
    0. The error bounds of the result enclose the given system, so that every proof holds for the
    given system too.
    """
    rows, columns = np.arange(structure.columns), np.arange(structure.rows)
    parts = system.A, system.B[:, columns], system.C[rows], system.D[rows][:, columns]
    given = realisation(parts, system.dt or 0.0)
    out, into = _powers(bilinear_continuous(given) if given.dt else given, structure)

    def coordinates(A: RealArray, B: RealArray, C: RealArray) -> RealArray | None:
        return balanced_coordinates(A, B / into, out[:, None] * C)

    stable = stable_system(given, sampled=True, coordinates=coordinates)
    even = replace(stable, period=0.0).channels(rows, columns, out, 1 / into)
    return even, stable.period


def analysed(system: Any) -> UncertainSystem:
    """The uncertain system; raises InputError if the question of its robustness has no meaning."""
    found = uncertain(system, "system")
    if not found.elements:
        raise InputError("the system has no uncertain element; there is nothing to be robust to")
    worst, beyond = worst_pole(found.nominal)
    if beyond >= 0:
        raise InputError(f"the system is unstable at its nominal: it has a pole at {worst:.6g}")
    return found


def in_loops(found: UncertainSystem) -> UncertainSystem:
    """The system without repetitions, and without elements that cannot move its poles.

    Elements without effect on the poles are those that cancel, as k in k - k, and those with no
    channel in a loop: det(I - M Delta) is a product with a factor for each loop, and no factor
    depends on them.
    """
    value = found.reduced().value
    inner = value.blocks[0]
    _, loops = connected_components(csr_array(inner != 0), connection="strong")
    closed = (np.bincount(loops)[loops] > 1) | (np.abs(np.diagonal(inner)) > SELF_ROUNDING)
    looped = {name for name, there in zip(value.names, closed, strict=True) if there}
    idle = set(value.names) - looped - {INTEGRATOR}
    elements = {
        name: one for name, one in found.elements.items() if looped.intersection(one.channels)
    }
    return replace(found, value=without_channels(value, idle), elements=elements)


def _powers(plane: StateSpace, structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Powers of two for outputs (c,) and inputs (r,), from the median of the D scalings over
    frequency.
    """
    omega = frequencies_of(plane)
    omega = omega[:: max(len(omega) // FREQUENCIES, 1)]
    D = upper_bound(response(plane, omega), structure.complexified()).D_left
    size = np.log2(np.maximum(np.diagonal(D, axis1=1, axis2=2).real, np.finfo(float).tiny)) / 2
    size -= size.mean(axis=1)[:, None]
    mean = np.median(size, axis=0)
    places = zip(structure, structure.column_slices, strict=True)
    steps = [float(np.round(mean[at].mean())) for _, at in places]
    out = np.repeat(steps, [block.columns for block in structure])
    into = np.repeat(steps, [block.rows for block in structure])
    return 2.0**out, 2.0**into
