"""Connection of parts with named signals into one realisation."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Array
from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.structure import Block, Structure
from workbench.systems.balancing import balancing, singular

Names = str | Sequence[str]
"""One name or several."""


class UncertainPart(ABC):
    """A system with its perturbation pulled out; it can be a block of a connection."""

    @property
    @abstractmethod
    def structure(self) -> Structure:
        """Blocks of the perturbation."""

    @property
    @abstractmethod
    def system(self) -> StateSpace:
        """System with named inputs (perturbation, inputs) and outputs (perturbation, outputs)."""


@dataclass(frozen=True, eq=False)
class NamedRealisation:
    """A realisation M = [A B; C D] with named signals; dt None fits every sampling time."""

    M: Array
    states: int
    dt: float | None
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


def named_realisation(block: Any) -> NamedRealisation:
    """The realisation of a block of a connection, with the names of its signals.

    A block is a StateSpace, a TransferFunction, an `UncertainPart`, or a tuple of one of these with
    names of its inputs and outputs. Raises InputError for another type, for a wrong number of
    names, and for an improper transfer function.
    """
    import control

    inputs = outputs = None
    if isinstance(block, tuple):
        block, inputs, outputs = block[0], names_of(block[1]), names_of(block[2])
    if isinstance(block, UncertainPart):
        r, block = block.structure.rows, block.system
        if inputs is not None and outputs is not None:
            inputs = (*block.input_labels[:r], *inputs)
            outputs = (*block.output_labels[:r], *outputs)
    if not isinstance(block, control.StateSpace | control.TransferFunction):
        raise InputError(
            f"a block is a {type(block).__name__}; it must be a StateSpace, a TransferFunction, a "
            "ParametricModel or an UncertaintyModel (fit measured responses first)"
        )
    inputs = tuple(block.input_labels) if inputs is None else inputs
    outputs = tuple(block.output_labels) if outputs is None else outputs
    if (len(inputs), len(outputs)) != (block.ninputs, block.noutputs):
        raise InputError(
            f"a block with {block.ninputs} inputs and {block.noutputs} outputs was given the names "
            f"{inputs} and {outputs}"
        )
    if isinstance(block, control.TransferFunction):
        # With several inputs and outputs, python-control's realisation shares states.
        siso = (block.ninputs, block.noutputs) == (1, 1)
        M, states = _companion(block) if siso else _stacked(control.ss(block))
    else:
        M, states = _stacked(block)
    return NamedRealisation(M, states, block.dt, inputs, outputs)


def _stacked(system: StateSpace) -> tuple[Array, int]:
    """[A B; C D] and the number of states."""
    return np.block([[system.A, system.B], [system.C, system.D]]), int(system.nstates)


def _companion(system: Any) -> tuple[Array, int]:
    """Realisation of a SISO transfer function with all its poles and scaled states."""
    num, den = (np.trim_zeros(part[0][0], "f") for part in (system.num, system.den))
    n = len(den) - 1
    if len(num) > n + 1:
        raise InputError(
            f"the transfer function {system.name!r} is improper: it has {len(num) - 1} zeros and "
            f"{n} poles; add fast poles, or a pole that belongs to it and stands elsewhere"
        )
    num = np.concatenate([np.zeros(n + 1 - len(num)), num]) / den[0]
    den = den / den[0]
    M = np.eye(n + 1, k=-1)
    M[0] = [*-den[1:], 1.0]
    M[n] = [*(num[1:] - num[0] * den[1:]), num[0]]
    rows, columns = balancing(M, n)
    rows[n:] = columns[n:] = 1.0
    return rows[:, None] * M * columns, n


def sum_of(name: str, terms: str) -> NamedRealisation:
    """A summing junction, such as ("e", "r - y"), as a part without states."""
    if not re.fullmatch(r"\s*[+-]?\s*[^\s+-]+(\s*[+-]\s*[^\s+-]+)*\s*", terms):
        raise InputError(
            f"the sum {name!r} is {terms!r}; write signal names with + and - between them"
        )
    found = re.findall(r"([+-]?)\s*([^\s+-]+)", terms)
    signs = [[-1.0 if sign == "-" else 1.0 for sign, _ in found]]
    return NamedRealisation(np.array(signs), 0, None, tuple(term for _, term in found), (name,))


def perturbation_of(
    perturbation: Sequence[tuple[Block, Names, Names]], blocks: Iterable[Any]
) -> tuple[list[Block], list[str], list[str]]:
    """Blocks of Delta, with the signals that they read and the signals that they drive."""
    entries = [(block, names_of(reads), names_of(drives)) for block, reads, drives in perturbation]
    for entry in blocks:
        model = entry[0] if isinstance(entry, tuple) else entry
        if isinstance(model, UncertainPart):
            places = zip(
                model.structure,
                model.structure.column_slices,
                model.structure.row_slices,
                strict=True,
            )
            z, w = model.system.output_labels, model.system.input_labels
            entries += [(block, tuple(z[c]), tuple(w[r])) for block, c, r in places]
    for block, reads, drives in entries:
        if (len(reads), len(drives)) != (block.columns, block.rows):
            raise InputError(
                f"{block} reads {block.columns} signals and drives {block.rows}, but was given "
                f"{reads} to read and {drives} to drive"
            )
    return (
        [block for block, _, _ in entries],
        [name for _, reads, _ in entries for name in reads],
        [name for _, _, drives in entries for name in drives],
    )


def connected(
    parts: Sequence[NamedRealisation], links: Array, enters: Array, leaves: Array
) -> tuple[Array, int]:
    """Realisation [A B; C D] of connected parts, and its number of states.

    v are the inputs of all parts, y their outputs and w the inputs of the whole. The connection is
    v = links y + enters w, and the outputs of the whole are leaves y. Raises InputError where a
    loop without dynamics is singular.
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
    """Raise InputError where a loop without dynamics is singular; name its signals."""
    _, member = connected_components(direct != 0.0, connection="strong")
    for label in np.unique(member):
        inside = np.flatnonzero(member == label)
        if singular(loop[np.ix_(inside, inside)]):
            raise InputError(
                f"the loop through {', '.join(names[i] for i in inside)} has no dynamics and its "
                "gain is 1, so that its signals are not determined; check signs and direct terms"
            )


def common_dt(parts: Sequence[NamedRealisation]) -> float | None:
    """The sampling time [s] of all parts, None if it is open; InputError where they differ."""
    times = {part.dt for part in parts if part.dt is not None}
    if len(times) > 1:
        raise InputError(
            f"sampling times {sorted(times)} in one connection (0 is continuous); convert to one"
        )
    return times.pop() if times else None


def names_of(names: Names) -> tuple[str, ...]:
    """A tuple of names from one name or several."""
    return (names,) if isinstance(names, str) else tuple(names)


def unique(names: Sequence[str]) -> list[str]:
    """Distinct names of outputs: a repeated name gets "#2", "#3" and so on behind it."""
    seen = [names[:i].count(name) + 1 for i, name in enumerate(names)]
    return [name if i == 1 else f"{name}#{i}" for name, i in zip(names, seen, strict=True)]


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
