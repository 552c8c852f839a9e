"""Generalised plants: systems with named signals, connected, with open places for Delta and K.

Inputs are (perturbation, exogenous, control), outputs (perturbation, performance, measurement).
Delta closes the upper loop and K the lower one, both with positive feedback.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag
from scipy.sparse.csgraph import connected_components

from workbench.errors import InputError, UnknownNameError
from workbench.structure import Block, Structure
from workbench.uncertainty.lft import Matrix, balancing, frequency_response, singular
from workbench.uncertainty.parametric import ParametricModel

if TYPE_CHECKING:
    from control import StateSpace

Names = str | Sequence[str]


@dataclass(frozen=True, eq=False)
class GeneralisedPlant:
    """A system with its uncertainty structure (None: no perturbation).

    The last `controls` inputs are K's, as are the last `measurements` outputs; what Delta leaves of
    the others is exogenous and performance. Raises InputError where the system has too few.
    """

    system: StateSpace
    structure: Structure | None
    controls: int
    measurements: int

    def __post_init__(self) -> None:
        if min(self.exogenous, self.performance, self.controls, self.measurements) < 0:
            raise InputError(
                f"a system with {self.system.ninputs} inputs and {self.system.noutputs} outputs; "
                f"the structure needs {self._delta[1]} and {self._delta[0]} of them, the "
                f"controller {self.controls} and {self.measurements}"
            )

    @property
    def _delta(self) -> tuple[int, int]:
        """Perturbation outputs and inputs."""
        return (self.structure.columns, self.structure.rows) if self.structure else (0, 0)

    @property
    def exogenous(self) -> int:
        """Number of exogenous inputs."""
        return int(self.system.ninputs) - self._delta[1] - self.controls

    @property
    def performance(self) -> int:
        """Number of performance outputs."""
        return int(self.system.noutputs) - self._delta[0] - self.measurements

    def response(self, omega: ArrayLike) -> Matrix:
        """At `omega` [rad/s] (F,): (F, outputs, inputs)."""
        return response(self.system, omega)

    def close(self, K: Any) -> StateSpace:
        """N = F_l(P, K), u = K y, with every state of P and K, so that its poles tell stability.

        K is a StateSpace or a TransferFunction. Raises InputError where its size or sampling time
        does not fit, or the loop through the direct terms of P and K is singular.
        """
        plant = _part(self.system)
        controller = _part(K)
        if (len(controller.outputs), len(controller.inputs)) != (self.controls, self.measurements):
            raise InputError(
                f"K has {len(controller.inputs)} inputs and {len(controller.outputs)} outputs; the "
                f"plant has {self.measurements} measurements and {self.controls} controls"
            )
        p, m = len(plant.inputs), len(plant.outputs)
        open_inputs, open_outputs = p - self.controls, m - self.measurements
        links = np.zeros((p + self.measurements, m + self.controls))
        links[open_inputs:p, m:] = np.eye(self.controls)
        links[p:, open_outputs:m] = np.eye(self.measurements)
        enters, leaves = np.eye(len(links), open_inputs), np.eye(open_outputs, links.shape[1])
        M, states = _connected((plant, controller), links, enters, leaves)
        return _state_space(
            M,
            states,
            _common_dt((plant, controller)),
            plant.inputs[:open_inputs],
            plant.outputs[:open_outputs],
        )

    def partition(self, N: Matrix) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """N11, N12, N21, N22 of responses of N = close(K) (..., outputs, inputs).

        Index 1 is the perturbation's, 2 performance and exogenous. Raises InputError for another
        shape.
        """
        rows, columns = self._delta
        if N.shape[-2:] != (rows + self.performance, columns + self.exogenous):
            raise InputError(
                f"N has shape {N.shape}; the closed plant has {rows + self.performance} outputs "
                f"and {columns + self.exogenous} inputs"
            )
        above, below = N[..., :rows, :], N[..., rows:, :]
        return (
            above[..., :columns],
            above[..., columns:],
            below[..., :columns],
            below[..., columns:],
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

    A signal is driven in one place, a block's output, a sum or an input of the whole, and read in
    any number of places.

    Parameters
    ----------
    blocks
        StateSpace or TransferFunction with named signals, `ParametricModel`, or
        (system, input names, output names). Perturbations of a parametric model are joined behind
        those of `perturbation`.
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
        A signal that is read but driven by nothing.
    InputError
        A signal driven twice, an input that nothing reads, a block of Delta that does not fit its
        signals, improper or sampled differently, or a singular loop without dynamics.

    Examples
    --------
    >>> import control
    >>> G = control.tf(1, [1, 1], inputs="v", outputs="x")
    >>> plant = generalised_plant(
    ...     [G, (control.tf(0.1, 1), "u", "y_c")],
    ...     {"v": "u + u_c", "e": "r - x"},
    ...     perturbation=[(Full(1, 1), "y_c", "u_c")],
    ...     exogenous="r", control="u", performance="e", measurement="e",
    ... )
    """
    parts = [*(_part(block) for block in blocks), *(_sum(*item) for item in sums.items())]
    deltas, reads, drives = _perturbation(perturbation, blocks)
    externals = (*drives, *_names(exogenous), *_names(control))
    results = (*reads, *_names(performance), *_names(measurement))

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
    M, states = _connected(parts, read[:, :split], read[:, split:], left[:, :split])
    M[states:, states:] += left[:, split:]
    system = _state_space(M, states, _common_dt(parts), externals, _unique(results))
    structure = Structure(deltas) if deltas else None
    return GeneralisedPlant(system, structure, len(_names(control)), len(_names(measurement)))


def response(system: StateSpace, omega: ArrayLike) -> Matrix:
    """Response of a StateSpace at `omega` [rad/s] (F,): (F, outputs, inputs).

    Raises InputError at a pole.
    """
    part = _part(system)
    s = 1j * np.atleast_1d(np.asarray(omega, dtype=float))
    return frequency_response(part.M, part.states, np.exp(s * part.dt) if part.dt else s)


# --- parts and their connection ---------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Part:
    """[A B; C D] with named signals; dt None fits every sampling time."""

    M: Matrix
    states: int
    dt: float | None
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


def _part(block: Any) -> _Part:
    import control

    inputs = outputs = None
    if isinstance(block, tuple):
        block, inputs, outputs = block[0], _names(block[1]), _names(block[2])
    if isinstance(block, ParametricModel):
        r, block = block.structure.rows, block.system
        if inputs is not None and outputs is not None:
            inputs = (*block.input_labels[:r], *inputs)
            outputs = (*block.output_labels[:r], *outputs)
    inputs = tuple(block.input_labels) if inputs is None else inputs
    outputs = tuple(block.output_labels) if outputs is None else outputs
    if (len(inputs), len(outputs)) != (block.ninputs, block.noutputs):
        raise InputError(
            f"a block with {block.ninputs} inputs and {block.noutputs} outputs was given the names "
            f"{inputs} and {outputs}"
        )
    if isinstance(block, control.TransferFunction):
        # Of several inputs and outputs a realisation must share states: python-control's does.
        siso = (block.ninputs, block.noutputs) == (1, 1)
        M, states = _companion(block) if siso else _stacked(control.ss(block))
    elif isinstance(block, control.StateSpace):
        M, states = _stacked(block)
    else:
        raise InputError(
            f"a block is a {type(block).__name__}; it must be a StateSpace, a TransferFunction or "
            "a ParametricModel (fit measured responses first)"
        )
    return _Part(M, states, block.dt, inputs, outputs)


def _stacked(system: StateSpace) -> tuple[Matrix, int]:
    return np.block([[system.A, system.B], [system.C, system.D]]), int(system.nstates)


def _companion(system: Any) -> tuple[Matrix, int]:
    """Realisation of a SISO transfer function with all its poles, its states scaled."""
    num, den = (np.trim_zeros(part[0][0], "f") for part in (system.num, system.den))
    n = len(den) - 1
    if len(num) > n + 1:
        raise InputError(f"the block {system.name!r} is improper; give its poles to another block")
    num = np.concatenate([np.zeros(n + 1 - len(num)), num]) / den[0]
    den = den / den[0]
    M = np.eye(n + 1, k=-1)
    M[0] = [*-den[1:], 1.0]
    M[n] = [*(num[1:] - num[0] * den[1:]), num[0]]
    rows, columns = balancing(M, n)
    rows[n:] = columns[n:] = 1.0
    return rows[:, None] * M * columns, n


def _sum(name: str, terms: str) -> _Part:
    """A summing junction as a part without states."""
    if not re.fullmatch(r"\s*[+-]?\s*[^\s+-]+(\s*[+-]\s*[^\s+-]+)*\s*", terms):
        raise InputError(
            f"the sum {name!r} is {terms!r}; write signal names with + and - between them"
        )
    found = re.findall(r"([+-]?)\s*([^\s+-]+)", terms)
    signs = [[-1.0 if sign == "-" else 1.0 for sign, _ in found]]
    return _Part(np.array(signs), 0, None, tuple(term for _, term in found), (name,))


def _perturbation(
    perturbation: Sequence[tuple[Block, Names, Names]], blocks: Iterable[Any]
) -> tuple[list[Block], list[str], list[str]]:
    """Blocks of Delta, and the signals that they read and drive."""
    entries = [(block, _names(reads), _names(drives)) for block, reads, drives in perturbation]
    for entry in blocks:
        model = entry[0] if isinstance(entry, tuple) else entry
        if isinstance(model, ParametricModel):
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


def _connected(
    parts: Sequence[_Part], links: Matrix, enters: Matrix, leaves: Matrix
) -> tuple[Matrix, int]:
    """[A B; C D] of parts connected by v = links y + enters w, with the outputs leaves y.

    v are the inputs of all parts, y their outputs, w the inputs of the whole.
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


def _split(part: _Part) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    n = part.states
    return part.M[:n, :n], part.M[:n, n:], part.M[n:, :n], part.M[n:, n:]


def _check_loops(direct: Matrix, loop: Matrix, names: list[str]) -> None:
    """Raise InputError naming the signals of a loop without dynamics that has no solution."""
    _, member = connected_components(direct != 0.0, connection="strong")
    for label in np.unique(member):
        inside = np.flatnonzero(member == label)
        if singular(loop[np.ix_(inside, inside)]):
            raise InputError(
                f"the loop through {', '.join(names[i] for i in inside)} has no dynamics and its "
                "gain is 1, so that its signals are not determined; check signs and direct terms"
            )


def _common_dt(parts: Sequence[_Part]) -> float | None:
    times = {part.dt for part in parts if part.dt is not None}
    if len(times) > 1:
        raise InputError(
            f"sampling times {sorted(times)} in one connection (0 is continuous); convert to one"
        )
    return times.pop() if times else None


def _names(names: Names) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else tuple(names)


def _unique(names: Sequence[str]) -> list[str]:
    """Names of outputs; a signal that leaves more than once is numbered from its second time."""
    seen = [names[:i].count(name) + 1 for i, name in enumerate(names)]
    return [name if i == 1 else f"{name}#{i}" for name, i in zip(names, seen, strict=True)]


def _state_space(
    M: Matrix, states: int, dt: float | None, inputs: Sequence[str], outputs: Sequence[str]
) -> StateSpace:
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
