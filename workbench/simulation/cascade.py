"""Controllers put together: a detector, estimators, filters, switches, each a small part.

The parts run one after the other. Each is given signals by name: measurements, the outputs that the
converters gave at the sample before, and what parts in front of it told. The last part gives the
command. A strategy, what a controller is to see and do while a measurement is not to be trusted, is
such a cascade.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import RealArray
from workbench.errors import InputError
from workbench.simulation.controllers import Controller, idle
from workbench.simulation.machine import SLOTS, pointer

Whole = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Part:
    """A controller by name, what it is given and what it tells; `tells` is its name when left out.

    Raises InputError when it does not tell as many signals as the controller gives, and when it is
    given fewer than that reads.
    """

    name: str
    controller: Controller
    given: Sequence[str]
    tells: Sequence[str] = ()

    def __post_init__(self) -> None:
        if len(self.signals) != self.controller.outputs:
            raise InputError(
                f"part {self.name!r} tells {list(self.signals)}; its controller gives "
                f"{self.controller.outputs} outputs"
            )
        self.controller.need_measurements(len(self.given))

    @property
    def signals(self) -> tuple[str, ...]:
        return tuple(self.tells) or (self.name,)


@dataclass(frozen=True, eq=False)
class Cascade:
    """Parts in the order of their turns.

    measurements  names of what the loop measures (r,);
    parts         up to eight, the last one's outputs are the command (m,);
    previous      names of the outputs of the sample before, behind the converters (m,).

    Raises InputError for names given twice, a signal that nothing in front tells, too many parts.
    """

    measurements: Sequence[str]
    parts: Sequence[Part]
    previous: Sequence[str] = ("u_last",)

    def __post_init__(self) -> None:
        if not 0 < len(self.parts) <= SLOTS:
            raise InputError(f"{len(self.parts)} parts; a cascade has 1 to {SLOTS}")
        if len(self.previous) != self.parts[-1].controller.outputs:
            raise InputError(
                f"previous outputs {list(self.previous)}, but the last part "
                f"{self.parts[-1].name!r} tells {list(self.parts[-1].signals)}"
            )
        names = [part.name for part in self.parts]
        for what, each in (("parts", names), ("signals", list(self.signals))):
            twice = sorted({name for name in each if each.count(name) > 1})
            if twice:
                raise InputError(f"two {what} are called {', '.join(twice)}")
        known = [*self.measurements, *self.previous]
        for part in self.parts:
            unknown = [name for name in part.given if name not in known]
            if unknown:
                raise InputError(
                    f"part {part.name!r} is given {', '.join(unknown)}, which nothing in front of "
                    f"it tells; known: {', '.join(known)}"
                )
            known += part.signals

    @property
    def signals(self) -> tuple[str, ...]:
        """All of them, in the order of a sample's row."""
        told = (name for part in self.parts for name in part.signals)
        return (*self.measurements, *self.previous, *told)

    @property
    def plain(self) -> bool:
        """Whether a part is in plain Python, which makes all of the loop slow."""
        return any(part.controller.plain for part in self.parts)

    def check_period(self, period: float) -> None:
        """Raises InputError when a part was made for another period [s]."""
        for part in self.parts:
            own = part.controller.period
            if own is not None and not np.isclose(own, period, rtol=1e-9, atol=0.0):
                raise InputError(
                    f"part {part.name!r} has the sample time {own} s, the loop {period} s"
                )


def alone(controller: Controller, measurements: int) -> Cascade:
    """A controller that is given everything that is measured."""
    names = [f"measurement {i}" for i in range(measurements)]
    outputs = range(controller.outputs)
    part = Part("controller", controller, names, [f"output {i}" for i in outputs])
    return Cascade(names, [part], [f"last output {i}" for i in outputs])


class Slots(NamedTuple):
    """A cascade as the machine takes it, idle slots behind its parts; a copy of every state."""

    steps: tuple[Any, ...]
    states: tuple[RealArray, ...]
    parameters: tuple[RealArray, ...]
    wires: tuple[Whole, ...]
    given: tuple[RealArray, ...]
    told: tuple[RealArray, ...]
    places: Whole


def slots(cascade: Cascade, memory: dict[str, RealArray]) -> Slots:
    """Slots of a cascade; a part whose name has a state in `memory` goes on from it.

    Raises InputError when it would take over another number of states.
    """
    names, place = cascade.signals, len(cascade.measurements) + len(cascade.previous)
    rows: list[tuple[Any, ...]] = []
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
        if not law.plain:
            law.step.compile(pointer(4).signature)
        from_where = np.array([names.index(name) for name in part.given], np.int64)
        desk = np.zeros(len(part.given)), np.zeros(law.outputs)
        rows.append((law.step, state, _vector(law.parameters), from_where, *desk, place))
        place += law.outputs
    spare = idle(0)
    spare.step.compile(pointer(4).signature)
    none = np.zeros(0)
    rows += [(spare.step, none, none, np.zeros(0, np.int64), none, none, 0)] * (SLOTS - len(rows))
    columns: list[tuple[Any, ...]] = list(zip(*rows, strict=True))
    steps, states, parameters, wires, given, told, places = columns
    return Slots(steps, states, parameters, wires, given, told, np.array(places, np.int64))


def carried(part: Part) -> int:
    """How many states it hands over, and takes over."""
    law = part.controller
    return np.size(law.state) if law.carried is None else law.carried


def _vector(values: Any) -> RealArray:
    return np.ascontiguousarray(values, float)
