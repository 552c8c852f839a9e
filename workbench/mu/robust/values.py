"""Perturbations as values of the elements of an uncertain system."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from workbench._core.heavy_types import StateSpace
from workbench.structure import Full, Real, Structure
from workbench.systems.hidden_states import without_hidden_states
from workbench.uncertainty.algebra.elements import Element


def values_of(
    elements: Iterable[Element], structure: Structure, Delta: StateSpace
) -> dict[str, Any]:
    """A perturbation as values of the elements, by name."""
    import control

    values: dict[str, Any] = {}
    places = zip(
        elements,
        structure,
        structure.row_slices,
        structure.column_slices,
        strict=True,
    )
    for element, block, out, into in places:
        first = (out, into)
        if not isinstance(block, Full):  # a repeated scalar: its first entry is its value
            first = (slice(out.start, out.start + 1), slice(into.start, into.start + 1))
        D = Delta.D[first]
        if isinstance(block, Real):
            values[element.name] = element.value(D[0, 0])
            continue
        part = control.ss(Delta.A, Delta.B[:, first[1]], Delta.C[first[0]], D)
        part = without_hidden_states(part)
        values[element.name] = element.value(part)
    return values
