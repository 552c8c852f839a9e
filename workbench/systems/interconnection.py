"""Connection of parts with named signals to one realisation."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse.csgraph import connected_components

from workbench._core.arrays import Array
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import as_list, common_time_base
from workbench.structure import Block
from workbench.systems.balancing import singular
from workbench.systems.joints import UncertainPart, part_of
from workbench.systems.realisation import companion

Names = str | Sequence[str]
"""One name or several."""


@dataclass(frozen=True, eq=False)
class NamedRealisation:
    """A realisation M = [A B; C D] with named signals; dt None fits every sampling time.

    Unlike a `StateSpace`, it is one matrix, so that many systems are joined in one step.
    """

    M: Array
    states: int
    dt: float | None
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


def named_realisation(block: Any, name: str = "a block") -> NamedRealisation:
    """The realisation of a block of a connection, with the names of its signals.

    A block is anything that `part_of` takes, or a tuple of this with the names of its inputs and
    outputs. Raises InputError for another type, for a wrong number of names, and for an improper
    transfer function.
    """
    import control

    inputs = outputs = None
    if isinstance(block, tuple):
        if len(block) != 3:
            raise InputError(
                f"{name} is a tuple of {len(block)}; (system, inputs, outputs) is needed"
            )
        block, inputs, outputs = block[0], names_of(block[1]), names_of(block[2])
    block = part_of(block, name)
    if isinstance(block, UncertainPart):
        columns, rows, block = block.structure.columns, block.structure.rows, block.system
        if inputs is not None and outputs is not None:
            inputs = (*block.input_labels[:rows], *inputs)
            outputs = (*block.output_labels[:columns], *outputs)
    inputs = tuple(block.input_labels) if inputs is None else inputs
    outputs = tuple(block.output_labels) if outputs is None else outputs
    if (len(inputs), len(outputs)) != (block.ninputs, block.noutputs):
        raise InputError(
            f"a block with {block.ninputs} inputs and {block.noutputs} outputs was given the names "
            f"{inputs} and {outputs}"
        )
    if isinstance(block, control.TransferFunction):
        # python-control's realisation for several inputs and outputs shares states.
        siso = (block.ninputs, block.noutputs) == (1, 1)
        M, states = companion(block) if siso else _stacked(control.ss(block))
    else:
        M, states = _stacked(block)
    return NamedRealisation(M, states, block.dt, inputs, outputs)


def _stacked(system: StateSpace) -> tuple[Array, int]:
    """[A B; C D] and the number of states."""
    return np.block([[system.A, system.B], [system.C, system.D]]), int(system.nstates)


def sum_of(name: str, terms: str) -> NamedRealisation:
    """A summing junction, such as ("e", "r - y"), as a part without states."""
    if not isinstance(terms, str) or not re.fullmatch(
        r"\s*[+-]?\s*[^\s+-]+(\s*[+-]\s*[^\s+-]+)*\s*", terms
    ):
        raise InputError(
            f"the sum {name!r} is {terms!r}; write signal names with + and - between them"
        )
    found = re.findall(r"([+-]?)\s*([^\s+-]+)", terms)
    signs = [[-1.0 if sign == "-" else 1.0 for sign, _ in found]]
    return NamedRealisation(np.array(signs), 0, None, tuple(term for _, term in found), (name,))


def tested_of(blocks: Sequence[Any]) -> tuple[str, ...]:
    """The tests of the records from which uncertain blocks were identified, each listed once."""
    parts = [part_of(one[0] if isinstance(one, tuple) else one, "a block") for one in blocks]
    told = [words for part in parts if isinstance(part, UncertainPart) for words in part.tested]
    return tuple(dict.fromkeys(told))


def named_parts(
    blocks: Sequence[Any], perturbation: Sequence[tuple[Block, Names, Names]]
) -> tuple[list[NamedRealisation], list[tuple[Block, tuple[str, ...], tuple[str, ...]]]]:
    """Realisations of blocks, and entries of Delta: block, signals it reads, signals it drives.

    The entries of uncertain blocks come after those of `perturbation`. If two uncertain blocks have
    perturbations of the same name, the second one's names get the suffix "#2", and so on. Raises
    InputError if a block of Delta does not fit its signals.
    """
    parts = []
    entries = []
    for given in as_list(perturbation, "perturbation"):
        if not (
            isinstance(given, tuple | list) and len(given) == 3 and isinstance(given[0], Block)
        ):
            raise InputError(
                f"an entry of perturbation is (block of Delta, what it reads, what it drives), not "
                f"{given!r}"
            )
        entries.append((given[0], names_of(given[1]), names_of(given[2])))
    taken: list[str] = []
    known: dict[str, int] = {}
    for number, given in enumerate(as_list(blocks, "blocks"), start=1):
        part = named_realisation(given, f"block {number}")
        model = part_of(given[0] if isinstance(given, tuple) else given, f"block {number}")
        if isinstance(model, UncertainPart):
            for name in model.known_by_name:
                if name in known:
                    raise InputError(
                        f"blocks {known[name]} and {number} both hold the uncertain element "
                        f"{name!r}; put them together first, by append or feedback, so that it is "
                        "one perturbation"
                    )
                known[name] = number
            rows, columns = model.structure.rows, model.structure.columns
            own = [*part.inputs[:rows], *part.outputs[:columns]]
            names = unique([*taken, *own])[len(taken) :]
            taken += own
            part = replace(
                part,
                inputs=(*names[:rows], *part.inputs[rows:]),
                outputs=(*names[rows:], *part.outputs[columns:]),
            )
            structure = model.structure
            entries += [
                (block, part.outputs[columns], part.inputs[rows])
                for block, columns, rows in zip(
                    structure, structure.column_slices, structure.row_slices, strict=True
                )
            ]
        parts.append(part)
    for block, reads, drives in entries:
        if (len(reads), len(drives)) != (block.columns, block.rows):
            raise InputError(
                f"{block} reads {block.columns} signals and drives {block.rows}, but was given "
                f"{reads} to read and {drives} to drive"
            )
    return parts, entries


def connected(
    parts: Sequence[NamedRealisation], links: Array, enters: Array, leaves: Array
) -> tuple[Array, int]:
    """Realisation [A B; C D] of connected parts, and its number of states.

    v are the inputs of all parts, y their outputs and w the inputs of the connected system. The
    connection is v = links y + enters w, and the outputs of the connected system are leaves y.
    Raises InputError if a loop without dynamics is singular.
    """
    A, B, C, D = (block_diag(*matrices) for matrices in zip(*map(_split, parts), strict=True))
    direct = D @ links
    loop = np.eye(len(D)) - direct
    _check_loops(direct, loop, [name for part in parts for name in part.outputs])
    # y = C x + D v with v = links y + enters w
    n = len(A)
    y = np.linalg.solve(loop, np.hstack([C, D @ enters]))
    v = links @ y
    v[:, n:] += enters
    x = B @ v
    x[:, :n] += A
    return np.vstack([x, leaves @ y]), n


def _split(part: NamedRealisation) -> tuple[Array, Array, Array, Array]:
    """The matrices A, B, C and D of a part."""
    n = part.states
    return part.M[:n, :n], part.M[:n, n:], part.M[n:, :n], part.M[n:, n:]


def _check_loops(direct: Array, loop: Array, names: list[str]) -> None:
    """Raise InputError if a loop without dynamics is singular, with the names of its signals."""
    _, member = connected_components(direct != 0.0, connection="strong")
    for label in np.unique(member):
        inside = np.flatnonzero(member == label)
        if singular(loop[np.ix_(inside, inside)]):
            raise InputError(
                f"the loop through {', '.join(names[i] for i in inside)} has no dynamics and its "
                "gain is 1, so that its signals are not determined; check signs and direct terms"
            )


def common_dt(parts: Sequence[NamedRealisation]) -> float | None:
    """The common sampling time [s] of parts, None if open; raises InputError if they do not fit."""
    return common_time_base(part.dt for part in parts)


def names_of(names: Names) -> tuple[str, ...]:
    """A tuple of names from one name or several; raises InputError for anything else."""
    found = [names] if isinstance(names, str) else as_list(names, "names of signals")
    for name in found:
        if not isinstance(name, str):
            raise InputError(f"{name!r} is no name of a signal; a text is needed")
    return tuple(found)


def unique(names: Sequence[str]) -> list[str]:
    """Distinct names of outputs: a repeated name gets the suffix "#2", "#3" and so on."""
    seen = [names[:i].count(name) + 1 for i, name in enumerate(names)]
    return [name if i == 1 else f"{name}#{i}" for name, i in zip(names, seen, strict=True)]


def own_name(name: str) -> str:
    """The name without the suffix that `unique` added."""
    return re.sub(r"#\d+$", "", name)


def state_space(
    M: Array, states: int, dt: float | None, inputs: Sequence[str], outputs: Sequence[str]
) -> StateSpace:
    """A StateSpace with all states of M = [A B; C D] and named signals; dt None: continuous."""
    import control

    n = states
    return control.StateSpace(
        M[:n, :n],
        M[:n, n:],
        M[n:, :n],
        M[n:, n:],
        0 if dt is None else dt,
        remove_useless_states=False,
        inputs=list(inputs),
        outputs=list(outputs),
    )
