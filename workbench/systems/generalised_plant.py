"""Generalised plants: a system with open places for Delta and K.

Inputs are (perturbation, exogenous, control), outputs (perturbation, performance, measurement).
Delta closes the upper loop and K the lower one, both with positive feedback. `connection` builds
one from systems with named signals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array
from workbench._core.heavy_types import Figure, StateSpace
from workbench.errors import InputError, UnknownNameError
from workbench.structure import Full, Structure
from workbench.systems.frequency_response import frequency_response
from workbench.systems.interconnection import (
    common_dt,
    connected,
    named_realisation,
    own_name,
    state_space,
)
from workbench.systems.joints import system_of
from workbench.systems.range_hints import warn_far_frequencies

Signals = str | int | Sequence[str | int] | None
"""A choice of signals from a list: one or several names or indices; None for all."""


@dataclass(frozen=True, eq=False)
class GeneralisedPlant:
    """A system with its uncertainty structure (None: no perturbation).

    Unlike a `StateSpace`, it says which signals belong to the perturbation, the performance and
    the controller.

    The first inputs and outputs belong to Delta, as many as `structure` has rows and columns. The
    last `controls` inputs and the last `measurements` outputs belong to K. The inputs between are
    exogenous, and the outputs between are performance. ``tested`` lists the tests of the records
    from which its parts were identified. Raises InputError if the system has too few inputs or
    outputs, and for a wrong type of system, structure or number.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.structure import Complex, Structure
    >>> from workbench.uncertainty import GeneralisedPlant
    >>> P = control.ss(-np.eye(1), np.ones((1, 3)), np.ones((3, 1)), np.zeros((3, 3)))
    >>> plant = GeneralisedPlant(P, Structure([Complex(1)]), controls=1, measurements=1)
    >>> plant.exogenous, plant.performance
    (1, 1)
    """

    system: StateSpace
    structure: Structure | None
    controls: int
    measurements: int
    tested: tuple[str, ...] = field(default=(), kw_only=True)

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

    @property
    def performance_structure(self) -> Structure:
        """Structure for robust performance: Delta, and a full block on the performance channels.

        Raises InputError for a plant without performance outputs or exogenous inputs.
        """
        if self.structure is None:
            return Structure([Full(self.exogenous, self.performance, name="performance")])
        return self.structure.with_performance(self.performance, self.exogenous)

    def response(self, omega: ArrayLike) -> Array:
        """Frequency response at `omega` [rad/s] (F,), shape (F, outputs, inputs)."""
        warn_far_frequencies(omega, self.system)
        return response(self.system, omega)

    def channel(
        self, *, performance: Signals = None, exogenous: Signals = None
    ) -> GeneralisedPlant:
        """The plant with only some performance outputs and exogenous inputs, in that order.

        Signals are chosen by name, or by index among the plant's performance outputs and exogenous
        inputs; None for all. Raises UnknownNameError for a name that the plant does not have, and
        InputError for such an index.
        """
        rows, columns = self._delta
        system = self.system
        z, y = np.split(np.arange(rows, system.noutputs), [self.performance])
        w, u = np.split(np.arange(columns, system.ninputs), [self.exogenous])
        chosen = _chosen(performance, [system.output_labels[i] for i in z], "performance output")
        entering = _chosen(exogenous, [system.input_labels[i] for i in w], "exogenous input")
        outputs = [*range(rows), *z[chosen], *y]
        inputs = [*range(columns), *w[entering], *u]
        return self._part(outputs, inputs, self.structure)

    def nominal(self) -> GeneralisedPlant:
        """The plant without the perturbation: Delta = 0, all states kept."""
        rows, columns = self._delta
        outputs, inputs = range(rows, self.system.noutputs), range(columns, self.system.ninputs)
        return self._part(list(outputs), list(inputs), None)

    def perturbation(self) -> GeneralisedPlant:
        """The plant with only its perturbation channels, as exogenous and performance channels."""
        rows, columns = self._delta
        outputs = [*range(rows), *range(rows + self.performance, self.system.noutputs)]
        inputs = [*range(columns), *range(columns + self.exogenous, self.system.ninputs)]
        return self._part(outputs, inputs, None)

    def controlled(self) -> StateSpace:
        """The part from the controls to the measurements, all states kept."""
        m, p = self.system.noutputs, self.system.ninputs
        outputs, inputs = range(m - self.measurements, m), range(p - self.controls, p)
        return self._part(list(outputs), list(inputs), None).system

    def unstructured(self) -> GeneralisedPlant:
        """The plant with perturbation channels counted as exogenous and performance channels."""
        return replace(self, structure=None)

    def weighted(
        self, *, performance: Sequence[Any] = (), exogenous: Sequence[Any] = ()
    ) -> GeneralisedPlant:
        """The plant with weights on its first performance outputs and exogenous inputs.

        Each weight is a number or a StateSpace of one input and output; a channel without one stays
        as it is. Raises InputError for more weights than channels.
        """
        import control

        system, (rows, columns) = self.system, self._delta
        for name, weights in (("performance", performance), ("exogenous", exogenous)):
            if len(weights) > getattr(self, name):
                raise InputError(
                    f"{len(weights)} {name} weights for a plant with {getattr(self, name)} "
                    f"{name} channels; give one for each, or fewer"
                )
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
        return replace(self, system=named)

    def _part(
        self, outputs: Sequence[int], inputs: Sequence[int], structure: Structure | None
    ) -> GeneralisedPlant:
        """Some outputs and inputs of the system, by index, with all states."""
        import control

        system = self.system
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
        return replace(self, system=part, structure=structure)

    def close(self, controller: Any) -> StateSpace:
        """The closed loop N = F_l(P, K) with u = K y.

        N keeps every state of P and K, so its poles decide internal stability. K is anything that
        `system_of` takes. Raises InputError if its size or sampling time does not fit, or if the
        loop through the direct terms of P and K is singular.
        """
        plant = named_realisation(self.system)
        controller = named_realisation(system_of(controller, "controller"), "K")
        if (len(controller.outputs), len(controller.inputs)) != (self.controls, self.measurements):
            raise InputError(
                f"controller has {len(controller.inputs)} inputs and {len(controller.outputs)} "
                f"outputs; the plant has {self.measurements} measurements and "
                f"{self.controls} controls"
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

    def named(self, controller: StateSpace) -> StateSpace:
        """K with inputs named after the plant's measurements and outputs after its controls."""
        import control

        inputs = [own_name(label) for label in self.system.output_labels[-self.measurements :]]
        outputs = list(self.system.input_labels[-self.controls :])
        return control.ss(controller, inputs=inputs, outputs=outputs)

    def diagram(self) -> Figure:
        """The block diagram of the plant, its perturbation and its controller, by signal names."""
        from workbench.figures.diagrams import plant_diagram

        rows, columns = self._delta
        outputs = [own_name(label) for label in self.system.output_labels]
        inputs = [own_name(label) for label in self.system.input_labels]
        z, w = rows + self.performance, columns + self.exogenous
        return plant_diagram(
            self.structure is not None, inputs[columns:w], outputs[rows:z], inputs[w:], outputs[z:]
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


def response(system: StateSpace, omega: ArrayLike) -> Array:
    """Frequency response of a StateSpace at `omega` [rad/s] (F,), shape (F, outputs, inputs).

    Raises InputError at a pole.

    Examples
    --------
    >>> import control
    >>> from workbench.systems import response
    >>> response(control.ss(-1.0, 1.0, 1.0, 0.0), [0.0, 1.0]).ravel().round(3).tolist()
    [(1+0j), (0.5-0.5j)]
    """
    part = named_realisation(system)
    s = 1j * np.atleast_1d(np.asarray(omega, dtype=float))
    return frequency_response(part.M, part.states, np.exp(s * part.dt) if part.dt else s)


def _chosen(signals: Signals, names: Sequence[str], kind: str) -> list[int]:
    """Indices of the chosen signals among `names`; `kind` is their name in messages."""
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
