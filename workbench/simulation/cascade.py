"""Cascades of small controllers: a detector, estimators, filters, switches and so on.

The parts run one after the other. Each reads signals by name: measurements, the converted outputs
of the previous sample, and the outputs of earlier parts. The last part gives the command. For
example a strategy, which decides what a controller reads and does while a measurement is
unreliable, is a cascade.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, NamedTuple

import numpy as np

from workbench._core.arrays import IntegerArray, RealArray
from workbench.errors import InputError
from workbench.simulation.controllers import Controller


@dataclass(frozen=True, eq=False)
class Part:
    """A controller in a cascade, with the names of its inputs and outputs.

    name        name of the part;
    controller  the controller;
    inputs      names of the signals that it reads;
    outputs     names of the signals that it gives; by default the name of the part.

    Raises InputError if the number of names differs from that of the controller's outputs, or is
    smaller than the number of measurements that it reads.

    Examples
    --------
    >>> from workbench.simulation import Part, adder
    >>> part = Part("sum", adder(), inputs=["a", "b"])
    >>> part.signals
    ('sum',)
    """

    name: str
    controller: Controller
    inputs: Sequence[str]
    _: KW_ONLY
    outputs: Sequence[str] = ()

    def __post_init__(self) -> None:
        if len(self.signals) != self.controller.outputs:
            raise InputError(
                f"part {self.name!r} names the outputs {list(self.signals)}; its controller gives "
                f"{self.controller.outputs}"
            )
        self.controller.need_measurements(len(self.inputs))

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of its outputs."""
        return tuple(self.outputs) or (self.name,)


@dataclass(frozen=True, eq=False)
class Cascade:
    """Parts that run one after the other at each sample.

    measurements  names (r,) of the measurements of the loop;
    parts         one or more; the outputs of the last one are the command (m,);
    previous      names (m,) of the outputs of the previous sample, after the converters.

    Raises InputError for repeated names, for a signal that no earlier part gives, and for too many
    parts.

    Examples
    --------
    >>> from workbench.simulation import Cascade, Part, ramped_gain, adder
    >>> parts = [Part("r", ramped_gain(6.0, 1.0, 0.1), ["y"]), Part("u", adder(), ["r", "y"])]
    >>> Cascade(["y"], parts, previous=["u_last"]).signals
    ('y', 'u_last', 'r', 'u')
    """

    measurements: Sequence[str]
    parts: Sequence[Part]
    _: KW_ONLY
    previous: Sequence[str] = ("u_last",)

    def __post_init__(self) -> None:
        if not self.parts:
            raise InputError("a cascade without parts; it needs one at least")
        if len(self.previous) != self.parts[-1].controller.outputs:
            raise InputError(
                f"previous outputs {list(self.previous)}, but the last part "
                f"{self.parts[-1].name!r} gives {list(self.parts[-1].signals)}"
            )
        names = [part.name for part in self.parts]
        for what, each in (("parts", names), ("signals", list(self.signals))):
            twice = sorted({name for name in each if each.count(name) > 1})
            if twice:
                raise InputError(f"two {what} are called {', '.join(twice)}")
        known = [*self.measurements, *self.previous]
        for part in self.parts:
            unknown = [name for name in part.inputs if name not in known]
            if unknown:
                raise InputError(
                    f"part {part.name!r} reads {', '.join(unknown)}, which no part before it "
                    f"gives; known: {', '.join(known)}"
                )
            known += part.signals

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of all signals, in the order of the row of a sample."""
        told = (name for part in self.parts for name in part.signals)
        return (*self.measurements, *self.previous, *told)

    @property
    def plain(self) -> bool:
        """Whether a part is plain Python, which makes the whole loop slow."""
        return any(part.controller.plain for part in self.parts)

    def check_period(self, dt: float) -> None:
        """Raise InputError if a part was made for another sampling period [s]."""
        for part in self.parts:
            own = part.controller.dt
            if own is not None and not math.isclose(own, dt, rel_tol=1e-9):
                raise InputError(f"part {part.name!r} has dt = {own} s, the loop dt = {dt} s")


def alone(controller: Controller, measurements: int) -> Cascade:
    """Cascade of a single controller that reads all measurements."""
    names = [f"measurement {i}" for i in range(measurements)]
    outputs = range(controller.outputs)
    part = Part("controller", controller, names, outputs=[f"output {i}" for i in outputs])
    return Cascade(names, [part], previous=[f"last output {i}" for i in outputs])


class Turn(NamedTuple):
    """What the call of a part needs.

    step        its step;
    state       its state, a copy, which the loop changes;
    parameters  parameters of the step;
    wires       for each input its place in the row of signals; none if they are neighbours there;
    given       space for the inputs, or that piece of the row;
    told        piece of the row for the outputs.
    """

    step: Any
    state: RealArray
    parameters: RealArray
    wires: IntegerArray
    given: RealArray
    told: RealArray


def turns(cascade: Cascade, memory: dict[str, RealArray], row: RealArray) -> list[Turn]:
    """Turns of the parts; one whose name is in `memory` continues from the state stored there.

    The parts read and write the row (S,) of a sample's signals. Raises InputError if the numbers of
    states differ.
    """
    names, place = cascade.signals, len(cascade.measurements) + len(cascade.previous)
    found: list[Turn] = []
    for part in cascade.parts:
        law = part.controller
        state = np.array(law.state, float)
        before = memory.get(part.name)
        if before is not None:
            if before.size != carried(part):
                raise InputError(
                    f"part {part.name!r} takes over {carried(part)} states; the one of that name "
                    f"before it left {before.size}"
                )
            state[: before.size] = before
        wires = [names.index(name) for name in part.inputs]
        given, told = np.zeros(len(wires)), row[place : place + law.outputs]
        if wires and wires == list(range(wires[0], wires[0] + len(wires))):
            given, wires = row[wires[0] : wires[-1] + 1], []
        parameters = np.ascontiguousarray(law.parameters, float)
        found.append(Turn(law.step, state, parameters, np.array(wires, np.int64), given, told))
        place += law.outputs
    return found


def carried(part: Part) -> int:
    """Number of states that a part hands over to, and takes over from, a part of the same name."""
    law = part.controller
    return np.size(law.state) if law.carried_states is None else law.carried_states
