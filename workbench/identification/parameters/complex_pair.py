"""Complex numbers for CasADi, which has none, as pairs of real expressions.

A model of a response is written once, as a formula in its parameters and s. With NumPy's complex
numbers the formula gives numbers; with pairs it gives a CasADi graph, which has exact derivatives.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class ComplexPair:
    """Complex number ``real + j imag`` of CasADi expressions, also for NumPy's exp, log, sqrt."""

    real: Any
    imag: Any = 0.0

    @classmethod
    def of(cls, value: Any) -> ComplexPair:
        """Convert a pair, a complex number, or a real number or expression to a pair."""
        if isinstance(value, ComplexPair):
            return value
        if isinstance(value, complex | np.complexfloating):
            return cls(float(value.real), float(value.imag))
        return cls(value)

    def __add__(self, other: Any) -> ComplexPair:
        other = ComplexPair.of(other)
        return ComplexPair(self.real + other.real, self.imag + other.imag)

    def __mul__(self, other: Any) -> ComplexPair:
        other = ComplexPair.of(other)
        return ComplexPair(
            self.real * other.real - self.imag * other.imag,
            self.real * other.imag + self.imag * other.real,
        )

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> ComplexPair:
        return ComplexPair(-self.real, -self.imag)

    def __sub__(self, other: Any) -> ComplexPair:
        return self + (-ComplexPair.of(other))

    def __rsub__(self, other: Any) -> ComplexPair:
        return ComplexPair.of(other) - self

    def __truediv__(self, other: Any) -> ComplexPair:
        other = ComplexPair.of(other)
        size = other.real * other.real + other.imag * other.imag
        return self * ComplexPair(other.real / size, -other.imag / size)

    def __rtruediv__(self, other: Any) -> ComplexPair:
        return ComplexPair.of(other) / self

    def __pow__(self, power: Any) -> ComplexPair:
        if not isinstance(power, int | np.integer):
            return (self.log() * power).exp()
        if power < 0:
            return 1.0 / self ** (-power)
        product = ComplexPair(1.0)
        for _ in range(power):
            product = product * self
        return product

    def conjugate(self) -> ComplexPair:
        """Complex conjugate."""
        return ComplexPair(self.real, -self.imag)

    def exp(self) -> ComplexPair:
        """Exponential."""
        import casadi as ca

        size = ca.exp(self.real)
        return ComplexPair(size * ca.cos(self.imag), size * ca.sin(self.imag))

    def log(self) -> ComplexPair:
        """Principal logarithm."""
        import casadi as ca

        size = self.real * self.real + self.imag * self.imag
        return ComplexPair(0.5 * ca.log(size), ca.atan2(self.imag, self.real))

    def sqrt(self) -> ComplexPair:
        """Principal square root."""
        return self**0.5

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **keywords: Any) -> Any:
        operation = _OPERATIONS.get(ufunc)
        if operation is None or method != "__call__" or keywords:
            return NotImplemented
        return operation(*map(ComplexPair.of, inputs))


_OPERATIONS: dict[np.ufunc, Callable[..., ComplexPair]] = {
    np.add: operator.add,
    np.subtract: operator.sub,
    np.multiply: operator.mul,
    np.true_divide: operator.truediv,
    np.negative: operator.neg,
    np.conjugate: ComplexPair.conjugate,
    np.square: lambda z: z * z,
    np.exp: ComplexPair.exp,
    np.log: ComplexPair.log,
    np.sqrt: ComplexPair.sqrt,
}
"""For each of NumPy's functions, the operation on pairs."""
