"""Connect systems by the names of their signals to form a generalised plant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from workbench.errors import InputError, UnknownNameError
from workbench.structure import Block, Structure
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.interconnection import (
    Names,
    common_dt,
    connected,
    named_parts,
    names_of,
    state_space,
    sum_of,
    tested_of,
    unique,
)


def generalised_plant(
    blocks: Sequence[Any],
    sums: Mapping[str, str],
    *,
    perturbation: Sequence[tuple[Block, Names, Names]] = (),
    exogenous: Names = (),
    control: Names = (),
    performance: Names = (),
    measurement: Names = (),
) -> GeneralisedPlant:
    """Connect systems by the names of their signals and leave Delta and K out.

    Each signal has one source: an output of a block, a sum or an input of the plant. Any number of
    blocks, sums and outputs may read it.

    Parameters
    ----------
    blocks
        Systems with named signals: StateSpace, TransferFunction, `ParametricModel`,
        `UncertaintyModel`, an answer, Solution or Run with one of these; or (one of these or a
        gain, input names, output names). The perturbations of uncertain ones come after those of
        `perturbation`.
    sums
        Summing junctions such as {"e": "w_p + w_u - x"}.
    perturbation
        (block of Delta, names of the signals it reads, names of those it drives).
    exogenous, control
        Names of the inputs.
    performance, measurement
        Names of signals that are outputs.

    Raises
    ------
    UnknownNameError
        A signal is read that has no source.
    InputError
        A signal has two sources; nothing reads an input; a block of Delta does not fit its signals;
        a block is improper or has another sampling time; or a loop without dynamics is singular.

    Examples
    --------
    >>> import control
    >>> from workbench.structure import Full
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf(1, [1, 1], inputs="v", outputs="x")
    >>> plant = generalised_plant(
    ...     [G, (control.tf(0.1, 1), "u", "y_c")],
    ...     {"v": "u + u_c", "e": "r - x"},
    ...     perturbation=[(Full(1, 1), "y_c", "u_c")],
    ...     exogenous="r", control="u", performance="e", measurement="e",
    ... )
    >>> plant.controls, plant.measurements, len(plant.structure)
    (1, 1, 1)
    """
    if not isinstance(sums, Mapping):
        raise InputError(f'sums must be a mapping such as {{"e": "r - y"}}, not {sums!r}')
    of_blocks, entries = named_parts(blocks, perturbation)
    parts = [*of_blocks, *(sum_of(*item) for item in sums.items())]
    deltas = [block for block, _, _ in entries]
    reads = [name for _, names, _ in entries for name in names]
    drives = [name for _, _, names in entries for name in names]
    externals = (*drives, *names_of(exogenous), *names_of(control))
    results = (*reads, *names_of(performance), *names_of(measurement))

    inputs = [name for part in parts for name in part.inputs]
    outputs = [name for part in parts for name in part.outputs]
    signals = [*outputs, *externals]
    for name in dict.fromkeys(signals):
        if signals.count(name) > 1:
            raise InputError(
                f"signal {name!r} is driven {signals.count(name)} times, by blocks, sums or inputs "
                "of the whole; add the drivers in a sum, or rename with (system, inputs, outputs)"
            )
    for name in (*inputs, *results):
        if name not in signals:
            raise UnknownNameError("signal", name, signals)
    for name in externals:
        if name not in (*inputs, *results):
            raise InputError(f"nothing reads the input {name!r}; connect it or leave it out")

    is_signal = np.eye(len(signals))
    read, left = (
        is_signal[[signals.index(name) for name in names]].reshape(-1, len(signals))
        for names in (inputs, results)
    )
    split = len(outputs)
    M, states = connected(parts, read[:, :split], read[:, split:], left[:, :split])
    M[states:, states:] += left[:, split:]
    system = state_space(M, states, common_dt(parts), externals, unique(results))
    structure = Structure(deltas) if deltas else None
    return GeneralisedPlant(
        system,
        structure,
        len(names_of(control)),
        len(names_of(measurement)),
        tested=tested_of(blocks),
    )
