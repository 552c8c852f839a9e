"""Generalised plants: connected systems with named signals, left open for Delta and K.

Inputs are (perturbation, exogenous, control), outputs (perturbation, performance, measurement).
Delta closes the upper loop and K the lower one, both with positive feedback.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.errors import InputError, UnknownNameError
from workbench.heavy_types import StateSpace
from workbench.structure import Block, Structure
from workbench.systems.frequency_response import frequency_response
from workbench.systems.interconnection import (
    Names,
    common_dt,
    connected,
    names_of,
    part_of,
    perturbation_of,
    state_space,
    sum_of,
    unique,
)

Signals = str | int | Sequence[str | int] | None
"""A choice from a list of signals: one or several names or numbers; None for all."""


@dataclass(frozen=True, eq=False)
class GeneralisedPlant:
    """A system with its uncertainty structure (None: no perturbation).

    The first inputs and outputs belong to Delta, as many as `structure` has rows and columns. The
    last `controls` inputs and the last `measurements` outputs belong to K. The inputs between are
    exogenous, and the outputs between are performance. Raises InputError where the system has too
    few inputs or outputs, and for a wrong type of system, structure or number.
    """

    system: StateSpace
    structure: Structure | None
    controls: int
    measurements: int

    def __post_init__(self) -> None:
        import control

        if not isinstance(self.system, control.StateSpace):
            raise InputError(
                f"system must be a StateSpace, not {type(self.system).__name__}; control.ss "
                "converts a TransferFunction"
            )
        if not (self.structure is None or isinstance(self.structure, Structure)):
            raise InputError(
                f"structure must be a Structure, not {type(self.structure).__name__}; "
                "Structure.from_pairs takes rows of two integers"
            )
        for name in ("controls", "measurements"):
            count = getattr(self, name)
            if isinstance(count, bool) or not isinstance(count, Integral):
                raise InputError(f"{name} is {count!r}; it must be a whole number")
        if min(self.exogenous, self.performance, self.controls, self.measurements) < 0:
            raise InputError(
                f"a system with {self.system.ninputs} inputs and {self.system.noutputs} outputs; "
                f"the structure needs {self._delta[1]} and {self._delta[0]} of them, the "
                f"controller {self.controls} and {self.measurements}"
            )

    @property
    def _delta(self) -> tuple[int, int]:
        """Numbers of perturbation outputs and inputs of the system."""
        return (self.structure.columns, self.structure.rows) if self.structure else (0, 0)

    @property
    def exogenous(self) -> int:
        """Number of exogenous inputs."""
        return int(self.system.ninputs) - self._delta[1] - self.controls

    @property
    def performance(self) -> int:
        """Number of performance outputs."""
        return int(self.system.noutputs) - self._delta[0] - self.measurements

    def response(self, omega: ArrayLike) -> Array:
        """Frequency response at `omega` [rad/s] (F,), shape (F, outputs, inputs)."""
        return response(self.system, omega)

    def channel(self, performance: Signals = None, exogenous: Signals = None) -> GeneralisedPlant:
        """The plant with only some performance outputs and exogenous inputs, in that order.

        Signals are chosen by name, or by number among the plant's performance outputs and exogenous
        inputs; None for all. Raises UnknownNameError for a name, and InputError for a number, that
        the plant does not have.
        """
        import control

        rows, columns = self._delta
        system = self.system
        z, y = np.split(np.arange(rows, system.noutputs), [self.performance])
        w, u = np.split(np.arange(columns, system.ninputs), [self.exogenous])
        chosen = _chosen(performance, [system.output_labels[i] for i in z], "performance output")
        entering = _chosen(exogenous, [system.input_labels[i] for i in w], "exogenous input")
        outputs = [*range(rows), *z[chosen], *y]
        inputs = [*range(columns), *w[entering], *u]
        part = control.StateSpace(
            system.A,
            system.B[:, inputs],
            system.C[outputs],
            system.D[np.ix_(outputs, inputs)],
            system.dt,
            remove_useless_states=False,
            inputs=[system.input_labels[i] for i in inputs],
            outputs=[system.output_labels[i] for i in outputs],
        )
        return GeneralisedPlant(part, self.structure, self.controls, self.measurements)

    def close(self, K: Any) -> StateSpace:
        """The closed loop N = F_l(P, K) with u = K y.

        N keeps every state of P and K, so its poles decide internal stability. K is a StateSpace
        or a TransferFunction. Raises InputError where its size or sampling time does not fit, or
        where the loop through the direct terms of P and K is singular.
        """
        plant = part_of(self.system)
        controller = part_of(K)
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
        M, states = connected((plant, controller), links, enters, leaves)
        return state_space(
            M,
            states,
            common_dt((plant, controller)),
            plant.inputs[:open_inputs],
            plant.outputs[:open_outputs],
        )

    def partition(self, N: Array) -> tuple[Array, Array, Array, Array]:
        """The parts N11, N12, N21, N22 of responses of N = close(K), (..., outputs, inputs).

        Index 1 stands for the perturbation, 2 for performance and exogenous signals. Raises
        InputError for another shape.
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

    Exactly one place drives each signal: the output of a block, a sum, or an input of the whole
    plant. Any number of places may read it.

    Parameters
    ----------
    blocks
        StateSpace or TransferFunction with named signals, `ParametricModel`, `UncertaintyModel`, or
        (one of these, input names, output names). The perturbations of uncertain models come after
        those of `perturbation`.
    sums
        Summing junctions such as {"e": "w_p + w_u - x"}.
    perturbation
        Tuples (block of Delta, names of the signals it reads, names of the signals it drives).
    exogenous, control
        Names of the inputs.
    performance, measurement
        Names of signals that are outputs.

    Raises
    ------
    UnknownNameError
        A signal that is read but driven by nothing.
    InputError
        A signal is driven twice; nothing reads an input; a block of Delta does not fit its
        signals; systems are improper or have different sampling times; or a loop without dynamics
        is singular.

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
    parts = [*(part_of(block) for block in blocks), *(sum_of(*item) for item in sums.items())]
    deltas, reads, drives = perturbation_of(perturbation, blocks)
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
    return GeneralisedPlant(system, structure, len(names_of(control)), len(names_of(measurement)))


def response(system: StateSpace, omega: ArrayLike) -> Array:
    """Frequency response of a StateSpace at `omega` [rad/s] (F,), shape (F, outputs, inputs).

    Raises InputError at a pole.
    """
    part = part_of(system)
    s = 1j * np.atleast_1d(np.asarray(omega, dtype=float))
    return frequency_response(part.M, part.states, np.exp(s * part.dt) if part.dt else s)


def _chosen(signals: Signals, names: Sequence[str], kind: str) -> list[int]:
    """Numbers among `names` of the chosen signals; `kind` is what messages call them."""
    if signals is None:
        return list(range(len(names)))
    try:
        asked = [signals] if isinstance(signals, str | int) else list(signals)
    except TypeError:
        raise InputError(
            f"{kind}s {signals!r}: give names, or numbers from 0 on, of the {len(names)} there are"
        ) from None
    chosen = []
    for signal in asked:
        if isinstance(signal, str):
            if signal not in names:
                raise UnknownNameError(kind, signal, names)
            chosen.append(list(names).index(signal))
        elif 0 <= signal < len(names):
            chosen.append(int(signal))
        else:
            raise InputError(f"there is no {kind} {signal}; the plant has {len(names)}, from 0")
    if not chosen or len(set(chosen)) < len(chosen):
        raise InputError(f"{kind}s {signals!r}: give at least one, and none twice")
    return chosen
