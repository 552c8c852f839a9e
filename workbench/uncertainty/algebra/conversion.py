"""Conversion of uncertainty models and parametric models to LFTs in named elements."""

from __future__ import annotations

import numpy as np

from workbench.structure import Complex, Full, Real
from workbench.systems.joints import UncertainPart
from workbench.uncertainty.algebra.elements import (
    ComplexElement,
    DynamicElement,
    Element,
    RealElement,
)
from workbench.uncertainty.algebra.lft import INTEGRATOR, LFT


def pulled_out(part: UncertainPart) -> tuple[LFT, dict[str, Element], float | None]:
    """The LFT of a model, its blocks as named elements, and its sampling time.

    Parameters keep their ranges. The scalars of an `UncertaintyModel` are normalised and belong to
    this model: two models have two different perturbations, even if both are called "complex".
    """
    system, structure = part.system, part.structure
    ranges = {one.name: one for one in getattr(part, "parameters", ())}
    names: list[str] = []
    elements: dict[str, Element] = {}
    rows, columns = [], []
    read = drive = 0
    for number, block in enumerate(structure, start=1):
        name = block.name or f"delta_{number}"
        element: Element
        if isinstance(block, Real):
            known = ranges.get(name)
            element = RealElement(name, 0.0, -1.0, 1.0, owner=part)
            if known is not None:
                ends = sorted(float(known.at(end)) for end in (-1.0, 1.0))
                element = RealElement(name, known.nominal, *ends)
        elif isinstance(block, Complex):
            element = ComplexElement(name, 0.0, 1.0, owner=part)
        else:
            assert isinstance(block, Full)
            element = DynamicElement(name, block.outputs, block.inputs, owner=part)
        size = max(block.rows, block.columns)
        once = element.channels
        names += once * block.rows if len(once) == 1 else once
        rows += [*range(read, read + block.columns)] + [-1] * (size - block.columns)
        columns += [*range(drive, drive + block.rows)] + [-1] * (size - block.rows)
        read, drive = read + block.columns, drive + block.rows
        elements[name] = element
    n = system.nstates
    outputs, inputs = system.noutputs, system.ninputs
    M = np.zeros((n + outputs + 1, n + inputs + 1))  # the last row and column are padding
    M[:-1, :-1] = np.block([[system.A, system.B], [system.C, system.D]])
    ordered_rows = [
        *range(n),
        *(n + k if k >= 0 else -1 for k in rows),
        *range(n + read, n + outputs),
    ]
    ordered_columns = [
        *range(n),
        *(n + k if k >= 0 else -1 for k in columns),
        *range(n + drive, n + inputs),
    ]
    value = LFT(M[np.ix_(ordered_rows, ordered_columns)], (INTEGRATOR,) * n + tuple(names))
    return value, elements, system.dt if n or system.dt else None
