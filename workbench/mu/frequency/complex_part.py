"""A complex part added to real scalars, because mu is not continuous in frequency without it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench._core.arrays import Array
from workbench.certify.stable_system import StableSystem, stable_system
from workbench.errors import InputError
from workbench.input_checks import need_positive, need_structure
from workbench.structure import Complex, Real, Structure


def complex_part_added(
    system: Any, structure: Structure, complex_part: float
) -> tuple[StableSystem, Structure]:
    """Add a complex scalar of size `complex_part` to every real scalar of a structure.

    Real scalars delta become delta + complex_part * delta_c. In the returned system and structure,
    the added complex blocks come last.

    Raises
    ------
    InputError
        `complex_part` is not positive, or there is no real scalar.

    References
    ----------
    Packard, Pandey, Continuity properties of the real/complex structured singular value, IEEE
    Trans. Automatic Control 38 (1993) 415-428.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import complex_part_added
    >>> from workbench.structure import Real, Structure
    >>> system = control.ss(control.tf([0.5], [1.0, 0.2, 1.0]))
    >>> _, structure = complex_part_added(system, Structure([Real(1)]), 0.01)
    >>> len(structure)
    2
    """
    need_structure(structure)
    need_positive(complex_part, "complex_part")
    places = zip(structure, structure.column_slices, structure.row_slices, strict=True)
    real = [(block, column, row) for block, column, row in places if isinstance(block, Real)]
    if not real:
        raise InputError(
            f"the structure {structure.to_pairs()} has no real scalar; leave complex_part out"
        )
    stable = stable_system(system, sampled=True)
    outputs = np.concatenate([np.arange(stable.D.shape[0])[column] for _, column, _ in real])
    inputs = np.concatenate([np.arange(stable.D.shape[1])[row] for _, _, row in real])
    c, r = stable.D.shape
    larger = stable.channels(
        np.concatenate([np.arange(c), outputs]),
        np.concatenate([np.arange(r), inputs]),
        np.concatenate([np.ones(c), np.full(len(outputs), complex_part)]),
    )
    added = [Complex(block.rows, name=f"{block.name} complex".strip()) for block, _, _ in real]
    return larger, Structure((*structure, *added))


def summed(Delta: Array, structure: Structure, complex_part: float) -> Array:
    """The perturbation of the original system that has the same effect as one of the system with
    complex parts.
    """
    whole = Delta[: structure.rows, : structure.columns].copy()
    at = structure.rows, structure.columns
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        if isinstance(block, Real):
            n = block.rows
            whole[row, column] += complex_part * Delta[at[0] : at[0] + n, at[1] : at[1] + n]
            at = at[0] + n, at[1] + n
    return whole


def separated(Delta: Array, structure: Structure, complex_part: float) -> Array:
    """The smallest perturbation of the system with complex parts that has the same effect as Delta
    (r, c).

    Each delta = a + j b is t + complex_part * z with real t; |t| and |z| are at most the least
    radius for which both reach it.
    """
    places = zip(structure, structure.row_slices, structure.column_slices, strict=True)
    real = [(block.rows, row, column) for block, row, column in places if isinstance(block, Real)]
    added = sum(n for n, _, _ in real)
    whole = np.zeros(np.add(Delta.shape, added), complex)
    whole[: structure.rows, : structure.columns] = Delta
    at = structure.rows, structure.columns
    for n, row, column in real:
        delta = complex(Delta[row, column][0, 0])
        a, b = abs(delta.real), abs(delta.imag)
        radius = b / complex_part
        if radius < a:  # then |t| is the radius too
            root = max(a * a - (1 - complex_part * complex_part) * abs(delta) ** 2, 0.0)
            radius = abs(delta) ** 2 / (a + math.sqrt(root))
        t = math.copysign(min(a, radius), delta.real)
        whole[row, column] = t * np.eye(n)
        z = (delta - t) / complex_part * np.eye(n)
        whole[at[0] : at[0] + n, at[1] : at[1] + n] = z
        at = at[0] + n, at[1] + n
    return whole
