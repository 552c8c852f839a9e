"""Uncertain elements: real and complex scalars in a range, and dynamics with bounded gain.

Each element stands for a normalised perturbation of size at most 1. Its channels in an LFT have
names: a scalar has one name, and a block of dynamics (r, c) has one for each of max(r, c) channels.
"""

from __future__ import annotations

import math
import numbers
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from workbench._core.arrays import Array
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import is_real
from workbench.structure import Block, Complex, Full, Real
from workbench.systems.conversion import as_system


@dataclass(frozen=True)
class Element(ABC):
    """An uncertain element; two elements with the same name must be equal.

    ``owner`` is the model to which the element belongs. It distinguishes elements with equal
    default names: "complex" of one model and "complex" of another model are different elements.
    """

    name: str
    owner: Any = field(default=None, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise InputError(f"an element is called {self.name!r}; a name such as 'k' is needed")

    @property
    @abstractmethod
    def channels(self) -> tuple[str, ...]:
        """Names of the element's channels in an LFT."""

    @abstractmethod
    def block(self, occurrences: int) -> Block:
        """The element's block in the structure, if it occurs `occurrences` times."""

    @abstractmethod
    def delta(self, value: Any) -> Any:
        """The normalised perturbation for a value; raises InputError for anything that is no
        value.
        """

    @abstractmethod
    def value(self, delta: Any) -> Any:
        """The value that belongs to a normalised perturbation, in the element's own units."""

    @abstractmethod
    def sample(self, rng: np.random.Generator, speed: float) -> Any:
        """A random value; dynamics are about as fast as ``speed`` [rad/s]."""


@dataclass(frozen=True)
class RealElement(Element):
    """A real parameter from low to high, with its nominal between them.

    The value is nominal + a delta / (1 - c delta), which is low at -1, nominal at 0, high at 1.
    """

    nominal: float
    low: float
    high: float

    @property
    def bend(self) -> float:
        """The number c; 0 if the nominal is in the middle of the range."""
        up, down = self.high - self.nominal, self.nominal - self.low
        return (up - down) / (up + down)

    @property
    def slope(self) -> float:
        """The number a."""
        up, down = self.high - self.nominal, self.nominal - self.low
        return up * (2.0 * (down / (up + down)))  # the product of both may overflow or underflow

    @property
    def channels(self) -> tuple[str, ...]:
        return (self.name,)

    def block(self, occurrences: int) -> Block:
        return Real(occurrences, name=self.name)

    def delta(self, value: Any) -> float:
        if not is_real(value) or not math.isfinite(value):
            raise InputError(f"{self.name} = {value!r}; a real number is needed")
        away = float(value) - self.nominal
        below = self.slope + self.bend * away
        if below <= 0:
            raise InputError(
                f"{self.name} = {value:g} lies so far beyond its range from {self.low:g} to "
                f"{self.high:g} that no perturbation represents it"
            )
        return away / below

    def value(self, delta: Any) -> float:
        turn = float(np.real(delta))
        return self.nominal + self.slope * turn / (1.0 - self.bend * turn)

    def sample(self, rng: np.random.Generator, speed: float) -> float:
        return float(rng.uniform(self.low, self.high))


@dataclass(frozen=True)
class ComplexElement(Element):
    """A complex number within a radius of the nominal."""

    nominal: float
    radius: float

    @property
    def channels(self) -> tuple[str, ...]:
        return (self.name,)

    def block(self, occurrences: int) -> Block:
        return Complex(occurrences, name=self.name)

    def delta(self, value: Any) -> Any:
        if not isinstance(value, numbers.Number):  # dynamics with this value at a frequency
            return (as_system(value, self.name) - self.nominal) * (1.0 / self.radius)
        number = complex(value)  # type: ignore[call-overload]
        if not np.isfinite(number):
            raise InputError(f"{self.name} = {value!r}; it must be finite")
        if number.imag:
            raise InputError(
                f"{self.name} = {value!r}: a system with a complex coefficient has no real "
                "state space; give a real number, or `dynamics` for a phase"
            )
        return (number.real - self.nominal) / self.radius

    def value(self, delta: Any) -> Any:
        return self.nominal + self.radius * delta

    def sample(self, rng: np.random.Generator, speed: float) -> float:
        return float(self.nominal + self.radius * rng.uniform(-1.0, 1.0))


@dataclass(frozen=True)
class DynamicElement(Element):
    """A stable linear system (outputs, inputs) whose gain is at most 1 at every frequency."""

    outputs: int
    inputs: int

    @property
    def channels(self) -> tuple[str, ...]:
        if self.outputs == self.inputs == 1:
            return (self.name,)
        return tuple(f"{self.name}[{k}]" for k in range(max(self.outputs, self.inputs)))

    def block(self, occurrences: int) -> Block:
        if self.outputs == self.inputs == 1:
            return Complex(occurrences, name=self.name)
        if occurrences > 1:
            raise InputError(
                f"{self.name}, a block of {self.outputs} x {self.inputs}, occurs {occurrences} "
                "times; there are no bounds of mu for repeated full blocks: write the system so "
                "that it occurs once, as `feedback` does"
            )
        return Full(self.outputs, self.inputs, name=self.name)

    def delta(self, value: Any) -> Any:
        given = as_system(value, self.name)
        if (given.noutputs, given.ninputs) != (self.outputs, self.inputs):
            raise InputError(
                f"{self.name} has {self.outputs} outputs and {self.inputs} inputs, what was given "
                f"has {given.noutputs} and {given.ninputs}"
            )
        return given

    def value(self, delta: Any) -> Any:
        return delta

    def sample(self, rng: np.random.Generator, speed: float) -> StateSpace:
        """Random dynamics: a gain times a first-order all-pass, in random directions."""
        import control

        left, right = (self._direction(rng, size) for size in (self.outputs, self.inputs))
        corner = speed * 10.0 ** rng.uniform(-1.0, 1.0)
        gain = rng.uniform() ** 0.5 * rng.choice([-1.0, 1.0])
        D = gain * np.outer(left, right)
        return control.ss([[-corner]], right[None], -2.0 * corner * gain * left[:, None], D)

    @staticmethod
    def _direction(rng: np.random.Generator, size: int) -> Array:
        found: Array = rng.standard_normal(size)
        return found / np.linalg.norm(found)
