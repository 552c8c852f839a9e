"""Uncertain systems: state-space systems whose coefficients and parts are uncertain.

A system is an LFT in 1/s (sampled: 1/z) and in its normalised perturbations, so sums, products and
inverses of systems are those of LFTs (`workbench.uncertainty.algebra.lft`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array
from workbench._core.heavy_types import Figure, StateSpace
from workbench.errors import InputError, UnknownNameError
from workbench.input_checks import common_time_base, need_count, need_time_base
from workbench.structure import Structure
from workbench.systems.conversion import as_states
from workbench.systems.generalised_plant import GeneralisedPlant, response
from workbench.systems.joints import UncertainPart, part_of
from workbench.systems.range_hints import warn_far_frequencies
from workbench.systems.realisation import in_words, pole_sizes, realisation
from workbench.uncertainty.algebra import dead_time
from workbench.uncertainty.algebra.bundles import bundle
from workbench.uncertainty.algebra.closing import closed_above
from workbench.uncertainty.algebra.conversion import pulled_out
from workbench.uncertainty.algebra.elements import Element, RealElement
from workbench.uncertainty.algebra.identities import cancelling_names
from workbench.uncertainty.algebra.lft import INTEGRATOR, LFT, inverse, lft_quotient, lft_series
from workbench.uncertainty.algebra.reduction import grouped, reduced, without_channels

MOST_MEMBERS = 1_000_000
"""Largest number of members that can be drawn at once."""
MOST_VERTICES = 4096
"""Largest number of vertices that can be listed."""


class Algebraic(UncertainPart):
    """Base of objects with arithmetic, with systems, numbers and arrays on either side.

    ``*`` is the product of systems in series; a factor with one input and one output multiplies
    each entry.
    """

    # NumPy arrays and python-control systems then use this class's operators.
    __array_ufunc__: ClassVar[None] = None
    __array_priority__: ClassVar[float] = 100.0

    def __add__(self, other: Any) -> Any:
        return _combined(self, other, lambda a, b: a + b)

    def __radd__(self, other: Any) -> Any:
        return _combined(other, self, lambda a, b: a + b)

    def __sub__(self, other: Any) -> Any:
        return _combined(self, other, lambda a, b: a - b)

    def __rsub__(self, other: Any) -> Any:
        return _combined(other, self, lambda a, b: a - b)

    def __mul__(self, other: Any) -> Any:
        return _combined(self, other, lft_series)

    def __rmul__(self, other: Any) -> Any:
        return _combined(other, self, lft_series)

    def __matmul__(self, other: Any) -> Any:
        return _combined(self, other, lambda a, b: a @ b)

    def __rmatmul__(self, other: Any) -> Any:
        return _combined(other, self, lambda a, b: a @ b)

    def __truediv__(self, other: Any) -> Any:
        import control

        one = isinstance(other, control.TransferFunction) and other.issiso()
        if one and len(other.num[0][0]) > len(other.den[0][0]):
            # 1 / (s + 1) has a realisation, s + 1 has none.
            return _combined(self, 1 / other, lft_series)
        return _combined(self, other, lft_quotient)

    def __rtruediv__(self, other: Any) -> Any:
        return _combined(other, self, lft_quotient)

    def __neg__(self) -> Any:
        return _combined(-1.0, self, lft_series)


@dataclass(frozen=True)
class SignalNames:
    """The name of a system ("" without a name), and the names of its inputs and outputs."""

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class UncertainSystem(Algebraic):
    """A system with uncertain elements. A constant one is an uncertain number or matrix.

    `+ - * / **` and `@` work with other uncertain systems, with python-control's state-space
    systems and transfer functions, with uncertainty models, numbers and arrays, on either side.
    `feedback` does not repeat elements.

    ``value`` is the system's LFT, and ``elements`` are the uncertain elements by name. ``dt`` is
    the sampling time [s], 0 for continuous time, None for a constant. ``signals`` are the names for
    `interconnect`; None if no names were given.
    """

    value: LFT
    elements: Mapping[str, Element]
    _: KW_ONLY
    dt: float | None = None
    signals: SignalNames | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        need_time_base(self.dt)

    # --- what it is -------------------------------------------------------------------------------

    @property
    def noutputs(self) -> int:
        """Number of outputs."""
        return self.value.shape[0]

    @property
    def ninputs(self) -> int:
        """Number of inputs."""
        return self.value.shape[1]

    @property
    def nstates(self) -> int:
        """Number of states."""
        return self.value.names.count(INTEGRATOR)

    @property
    def name(self) -> str:
        """Name of the system; "" if none was given."""
        return self.signals.name if self.signals else ""

    @property
    def input_labels(self) -> list[str]:
        """Names of the inputs; by default u[0], u[1], ..."""
        return list(self.signals.inputs if self.signals else _numbered("u", self.ninputs))

    @property
    def output_labels(self) -> list[str]:
        """Names of the outputs; by default y[0], y[1], ..."""
        return list(self.signals.outputs if self.signals else _numbered("y", self.noutputs))

    def with_signals(self, signals: SignalNames | None) -> UncertainSystem:
        """The same system with other names of its signals."""
        return replace(self, signals=signals)

    def __repr__(self) -> str:
        called = f" {self.name}" if self.name else ""
        size = f"UncertainSystem{called}: {self.noutputs} outputs, {self.ninputs} inputs"
        late = dead_time.dead_times(self.elements)
        inside = f"{self.nstates} states" if late else f"nominal of {in_words(self.nominal)}"
        lines = [f"{size}, {inside}"]
        counts = self.value.repetitions()
        for element in self.elements.values():
            times = counts[element.channels[0]]
            lines.append(f"  {element}" + (f", {times} times" if times > 1 else ""))
        return "\n".join(lines)

    @property
    def known_by_name(self) -> tuple[str, ...]:
        return tuple(self.elements)

    @property
    def nominal(self) -> StateSpace:
        """The system with every element at its nominal."""
        return self.at()

    @property
    def lti(self) -> StateSpace:
        """The nominal system."""
        return self.nominal

    @cached_property
    def _grouped(self) -> LFT:
        """The LFT with the states first, followed by the channels of each element."""
        channels = [name for one in self.elements.values() for name in one.channels]
        return grouped(self.value, [INTEGRATOR, *channels])

    @cached_property
    def structure(self) -> Structure:
        """Blocks of the perturbation, one for each element, in the order of the elements.

        Raises InputError if there is no element, or if a block of dynamics with several channels
        occurs more than once.
        """
        counts = self.value.repetitions()
        return Structure(one.block(counts[one.channels[0]]) for one in self.elements.values())

    @cached_property
    def system(self) -> StateSpace:
        """System with inputs (perturbation, inputs) and outputs (perturbation, outputs)."""
        n, lft = self.nstates, self._grouped
        r = len(lft.names) - n
        rows, columns = list(range(n)), list(range(n))
        place = n
        for block, element in zip(self.structure, self.elements.values(), strict=True):
            rows += [*range(place, place + block.columns)]
            columns += [*range(place, place + block.rows)]
            place += max(block.rows, block.columns, len(element.channels))
        rows += [*range(n + r, n + r + self.noutputs)]
        columns += [*range(n + r, n + r + self.ninputs)]
        M = lft.M[np.ix_(rows, columns)]
        labels = [f"{b.name}[{i}]" for b in self.structure for i in range(b.columns)]
        drives = [f"{b.name}[{i}]" for b in self.structure for i in range(b.rows)]
        return realisation(
            (M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]),
            self.dt or 0.0,
            inputs=[*(f"w_{c}" for c in drives), *(f"u[{k}]" for k in range(self.ninputs))],
            outputs=[*(f"z_{c}" for c in labels), *(f"y[{k}]" for k in range(self.noutputs))],
        )

    def plant(self, measurements: int, controls: int) -> GeneralisedPlant:
        """The generalised plant whose last outputs are measured and last inputs are controlled."""
        return GeneralisedPlant(self.system, self.structure, controls, measurements)

    # --- members of the set -----------------------------------------------------------------------

    def at(self, **values: Any) -> StateSpace:
        """The system at values of elements by name; elements without a value are nominal.

        A value may also lie outside the range of its element.

        Raises
        ------
        UnknownNameError
            There is no element of that name.
        InputError
            A value does not fit its element, or the system is not well posed there.
        """
        for name in values:
            if name not in self.elements:
                raise UnknownNameError("uncertain element", name, list(self.elements))
        for late in dead_time.dead_times(self.elements).values():
            raise InputError(late.refusal)
        n, M = self.nstates, self._grouped.M
        parts = (M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:])
        counts = self.value.repetitions()
        deltas = [
            (one.delta(values[name]) if name in values else 0.0, counts[one.channels[0]], one)
            for name, one in self.elements.items()
        ]
        return closed_above(realisation(parts, self.dt or 0.0), deltas, values)

    def vertices(self) -> list[StateSpace]:
        """The systems at all vertices of the real parameters' ranges; other elements are
        nominal.
        """
        real = [one for one in self.elements.values() if isinstance(one, RealElement)]
        if 2 ** len(real) > MOST_VERTICES:
            raise InputError(f"{len(real)} real parameters have more than {MOST_VERTICES} vertices")
        ends = product(*((one.low, one.high) for one in real))
        names = [one.name for one in real]
        return [self.at(**dict(zip(names, values, strict=True))) for values in ends]

    def sample(self, count: int, *, seed: int | Sequence[int] = 0) -> list[StateSpace]:
        """Random members: parameters are uniform in their ranges, dynamics are all-passes with
        random gains.
        """
        need_count("count", count, MOST_MEMBERS)
        rng = np.random.default_rng(seed)
        sizes = pole_sizes(self.nominal)
        moving = sizes[sizes > 0]
        speed = float(np.exp(np.log(moving).mean())) if moving.size else 1.0
        return [
            self.at(**{name: one.sample(rng, speed) for name, one in self.elements.items()})
            for _ in range(count)
        ]

    def response(self, omega: ArrayLike) -> Array:
        """Nominal frequency response (F, outputs, inputs) at `omega` [rad/s] (F,).

        Known dead time is included exactly, as exp(-j omega T).
        """
        late = dead_time.dead_times(self.elements)
        if not late:
            warn_far_frequencies(omega, self.nominal)
            return response(self.nominal, omega)
        value, names = dead_time.channels_pulled_out(self.value, list(late))
        others = {name: one for name, one in self.elements.items() if name not in late}
        found = UncertainSystem(value, others, dt=self.dt).response(omega)
        return dead_time.closed_response(found, [late[name].delay for name in names], omega)

    def plot(self, *, samples: int = 30, seed: int = 0) -> Figure:
        """Gain over frequency of random members and the nominal; the largest gain for several
        channels.

        Samples prove nothing; `workbench.mu.worst_case_gain` does.
        """
        return bundle(self.nominal, self.sample(samples, seed=seed))

    @cached_property
    def cancelling(self) -> list[str]:
        """Names of elements on which no coefficient depends, such as k and j in k * j - j * k."""
        n, M = self.nstates, self._grouped.M
        # The states become additional inputs and outputs, at the end.
        lft = LFT(np.roll(M, -n, (0, 1)), self._grouped.names[n:])
        scalars = self._scalars
        return [scalars[channel] for channel in cancelling_names(lft, list(scalars))]

    @cached_property
    def without_effect(self) -> list[str]:
        """Names of elements that change neither a pole nor the response, such as d in L * d - L *
        d.
        """
        scalars = self._scalars
        found = cancelling_names(self._grouped, list(scalars), of_loops=True)
        return list(dict.fromkeys([*self.cancelling, *(scalars[channel] for channel in found)]))

    @property
    def _scalars(self) -> dict[str, str]:
        """Names of elements with one channel, by the channel's name."""
        every = self.elements.items()
        return {one.channels[0]: name for name, one in every if len(one.channels) == 1}

    def reduced(self) -> UncertainSystem:
        """The same system with fewer repetitions of its elements; all states are kept."""
        kept = [INTEGRATOR]
        for one in self.elements.values():
            exact = len(one.channels) > 1 or isinstance(one, dead_time.DeadTime)
            kept += one.channels if exact else ()
        idle = {self.elements[name].channels[0] for name in self.cancelling}
        value = without_channels(self._grouped, idle)
        return replace(self, value=reduced(value, keep=kept))._used()

    def __getitem__(self, key: Any) -> UncertainSystem:
        """Some outputs and inputs, by number or slice: ``P[0, 1]``, ``P[:2, :]``."""
        if not isinstance(key, tuple) or len(key) != 2:
            raise InputError(f"[{key!r}]: give outputs and inputs, such as P[0, :]")
        rows, columns = (
            np.atleast_1d(np.arange(size)[part])
            for part, size in zip(key, self.value.shape, strict=True)
        )
        chosen = np.eye(self.noutputs)[rows] @ self.value @ np.eye(self.ninputs)[:, columns]
        signals = self.signals and SignalNames(
            "",
            tuple(self.signals.inputs[j] for j in columns),
            tuple(self.signals.outputs[i] for i in rows),
        )
        return replace(self, value=chosen, signals=signals)._used()

    # --- arithmetic -------------------------------------------------------------------------------

    def __pow__(self, exponent: Any) -> UncertainSystem:
        if isinstance(exponent, bool) or not isinstance(exponent, int | np.integer):
            raise InputError(f"power {exponent!r} of a system; a whole number is needed")
        if self.noutputs != self.ninputs:
            raise InputError(f"power of a system of {self.noutputs} x {self.ninputs}")
        base = self.value if exponent >= 0 else inverse(self.value)
        value = LFT(np.eye(self.noutputs))
        for _ in range(abs(int(exponent))):
            value = value @ base
        return replace(self, value=value, signals=None)._used()

    def inverse(self) -> UncertainSystem:
        """The inverse; raises InputError if the direct term is singular at the nominal."""
        return replace(self, value=inverse(self.value), signals=None)

    def _used(self) -> UncertainSystem:
        """The system without elements that have no channels any more."""
        left = set(self.value.names)
        used = {name: one for name, one in self.elements.items() if left & set(one.channels)}
        return replace(self, elements=used)


def _numbered(prefix: str, count: int) -> list[str]:
    """Default names of signals, numbered as in python-control."""
    return [f"{prefix}[{k}]" for k in range(count)]


def uncertain(given: Any, name: str = "the system") -> UncertainSystem:
    """Any operand of the arithmetic as an uncertain system; a certain system has no elements.

    Raises InputError for anything else; `name` is what messages call it.
    """
    import control

    part = part_of(given, name)
    if isinstance(part, UncertainSystem):
        return part
    if isinstance(part, UncertainPart):
        value, elements, dt = pulled_out(part)
        return UncertainSystem(value, elements, dt=dt)
    system = part
    if isinstance(part, control.TransferFunction):
        system = as_states(part, name)
    M = np.block([[system.A, system.B], [system.C, system.D]]).astype(float)
    if not np.isfinite(M).all():
        raise InputError(f"{name} has entries that are not finite")
    dt = system.dt if system.nstates or system.dt else None
    return UncertainSystem(LFT(M, (INTEGRATOR,) * system.nstates), {}, dt=dt)


def with_channels(given: Any, name: str) -> UncertainSystem:
    """As `uncertain`; raises InputError if there are no inputs or no outputs to connect."""
    found = uncertain(given, name)
    if not all(found.value.shape):
        raise InputError(
            f"{name} has {found.noutputs} outputs and {found.ninputs} inputs; a system that is "
            "connected needs at least one of each: choose channels that it has, or leave it out"
        )
    return found


def combined_elements(parts: list[UncertainSystem]) -> dict[str, Element]:
    """Elements of several systems; raises InputError if two with the same name differ."""
    found: dict[str, Element] = {}
    for part in parts:
        for name, element in part.elements.items():
            if found.setdefault(name, element) != element:
                raise InputError(
                    f"two elements are called {name!r}: {found[name]} and {element}; an element is "
                    "known by its name: give one of them another"
                )
    return found


def common_time(parts: list[UncertainSystem]) -> float | None:
    """Common sampling time [s] of several systems; raises InputError if they do not fit."""
    return common_time_base(part.dt for part in parts)


def _combined(first: Any, second: Any, operation: Any) -> UncertainSystem:
    parts = [with_channels(first, "the left operand"), with_channels(second, "the right operand")]
    elements, dt = combined_elements(parts), common_time(parts)
    return UncertainSystem(operation(*(part.value for part in parts)), elements, dt=dt)._used()
