"""Generalised plants of a CD drive with other weights, and without their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from workbench.heavy_types import StateSpace
from workbench.uncertainty import GeneralisedPlant


def nominal_of(plant: GeneralisedPlant) -> GeneralisedPlant:
    """The plant without its perturbation."""
    rows, columns = (plant.structure.columns, plant.structure.rows) if plant.structure else (0, 0)
    outputs = list(plant.system.output_labels)[rows : rows + plant.performance]
    inputs = list(plant.system.input_labels)[columns : columns + plant.exogenous]
    return unstructured(plant).channel(outputs, inputs)


def unstructured(plant: GeneralisedPlant) -> GeneralisedPlant:
    """The plant whose perturbation counts as exogenous inputs and performance outputs."""
    return GeneralisedPlant(plant.system, None, plant.controls, plant.measurements)


def weighted(
    plant: GeneralisedPlant, performance: Sequence[Any] = (), exogenous: Sequence[Any] = ()
) -> GeneralisedPlant:
    """The plant with its first performance outputs and exogenous inputs behind weights.

    Each weight is a number or a StateSpace of one channel; the others stay as they are.
    """
    import control

    system, structure = plant.system, plant.structure
    rows, columns = (structure.columns, structure.rows) if structure else (0, 0)
    unit = control.ss([], [], [], [[1.0]])

    def diagonal(before: int, weights: Sequence[Any], size: int) -> StateSpace:
        after = size - before - len(weights)
        parts = [unit] * before + [unit * weight for weight in weights] + [unit] * after
        return control.append(*parts)

    product = (
        diagonal(rows, performance, system.noutputs)
        * system
        * diagonal(columns, exogenous, system.ninputs)
    )
    named = control.ss(product, inputs=system.input_labels, outputs=system.output_labels)
    return GeneralisedPlant(named, structure, plant.controls, plant.measurements)
