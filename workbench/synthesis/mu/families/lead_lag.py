"""Families of common controllers: PID, PI with lead and roll-off, decentralised."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.synthesis.mu.families import Family

LEAST_GAIN_SHARE = 1e-12
"""Least unit of a gain of a PID controller, relative to the largest gain; smaller gains count as
absent."""
ROOT_TOLERANCE = 1e-6
"""Relative distance up to which a root counts as real, and a pole as the fixed pole of a family."""


@dataclass(frozen=True)
class LeadLag(Family):
    """PI with lead and roll-off as a product of factors, with one input and one output,

        K(s) = sign g (s + z_1) ... (s + z_m) / ((s + leak) (s + p_1) ... (s + p_n)),

    with g, z and p positive. The parameters are log g, log z and log p. For m = n = 2 these are the
    zero of the PI part, zero and pole of the lead, and the roll-off. ``leak`` [rad/s] is the size
    of the fixed pole of the integrator.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.synthesis import LeadLag
    >>> family, x = LeadLag.of(control.tf([3.0, 3.0], [1.0, 10.1, 1.0]))
    >>> np.exp(x).round(4).tolist(), round(family.leak, 4)
    ([3.0, 1.0, 10.0], 0.1)
    """

    leak: float
    zeros: int = 2
    poles: int = 2
    sign: float = 1.0

    def __post_init__(self) -> None:
        if not (self.leak >= 0.0 and 0 <= self.zeros <= self.poles + 1):
            raise InputError(
                f"leak is {self.leak}, with {self.zeros} zeros and {self.poles} free poles; the "
                "leak must not be negative, and K must be proper"
            )

    @classmethod
    def of(cls, K: Any) -> tuple[LeadLag, RealArray]:
        """The family that contains a controller, and the controller's parameters.

        Its roots must be real and not right of the imaginary axis; the slowest pole is the leak.
        Raises InputError for other controllers.
        """
        import control

        K = control.ss(K)
        if (K.noutputs, K.ninputs) != (1, 1) or K.dt:
            raise InputError("a lead-lag controller has one input, one output and continuous time")
        zeros, poles = np.sort_complex(K.zeros()), np.sort_complex(K.poles())
        roots = np.concatenate([zeros, poles])
        if (
            not len(poles)
            or (np.abs(roots.imag) > ROOT_TOLERANCE * np.abs(roots)).any()
            or roots.real.max() > 0
        ):
            raise InputError(
                f"the controller has zeros {zeros} and poles {poles}; they must be real and not "
                "right of the imaginary axis, with a pole at least"
            )
        leak, fast = -poles.real[-1], -poles.real[:-1]
        s = 1j * float(np.exp(np.mean(np.log(np.append(fast, 1.0)))))
        value = complex(K(s)) * (s + leak) * np.prod(s + fast) / np.prod(s - zeros.real)
        family = cls(float(leak), len(zeros), len(fast), float(np.sign(value.real)))
        x = np.log(np.concatenate([[abs(value)], -zeros.real[::-1], fast[::-1]]))
        return family, x

    def system(self, x: RealArray) -> StateSpace:
        import control

        zeros, poles = self._roots(x)
        K = control.ss([], [], [], [[self.sign * float(np.exp(x[0]))]])
        for k, pole in enumerate(poles):
            direct, left = (1.0, zeros[k] - pole) if k < len(zeros) else (0.0, 1.0)
            K = control.ss(-pole, 1.0, left, direct) * K
        return K

    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        s = 1j * omega[:, None]
        zeros, poles = self._roots(x)
        K = self.sign * np.exp(x[0]) * (s + zeros).prod(axis=1) / (s + poles).prod(axis=1)
        logs = np.hstack([np.ones_like(s), zeros / (s + zeros), -poles[1:] / (s + poles[1:])])
        return K[:, None, None], (K[:, None] * logs)[:, :, None, None]

    def parameters(self, K: StateSpace) -> RealArray:
        family, x = LeadLag.of(K)
        near = abs(family.leak - self.leak) <= ROOT_TOLERANCE * max(self.leak, family.leak)
        if not near or (family.zeros, family.poles, family.sign) != (
            self.zeros,
            self.poles,
            self.sign,
        ):
            raise InputError(f"the controller belongs to {family}, not to {self}")
        return x

    def units(self, x: RealArray) -> RealArray:
        return np.ones_like(x)

    def _roots(self, x: RealArray) -> tuple[RealArray, RealArray]:
        """Sizes of the zeros and of the poles, the leak first [rad/s]."""
        zeros, poles = np.split(np.exp(x[1:]), [self.zeros])
        return zeros, np.concatenate([[self.leak], poles])


@dataclass(frozen=True)
class PID(Family):
    """K(s) = P + I / (s + leak) + D s / (T s + 1), with one input and one output.

    The parameters are P, I and D, each divided by its own unit (``gains``), and log T.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import PID
    >>> family, x = PID.of(P=2.0, I=1.0, D=0.1, T=0.01, leak=0.0)
    >>> bool(np.isclose(family.system(x)(2j), 2.0 + 1 / 2j + 0.1 * 2j / (0.01 * 2j + 1)))
    True
    """

    gains: tuple[float, float, float]
    leak: float = 0.0

    @classmethod
    def of(cls, P: float, I: float, D: float, T: float, leak: float = 0.0) -> tuple[PID, RealArray]:  # noqa: E741
        """The family with units from given gains, and its parameters; T [s] and leak [rad/s]."""
        given = np.array([P, I, D], dtype=float)
        if not (np.isfinite(given).all() and T > 0.0 and leak >= 0.0 and given.any()):
            raise InputError(
                f"P, I, D = {P}, {I}, {D} and T = {T}, leak = {leak}: gains must be finite and not "
                "all zero, T positive, the leak not negative"
            )
        size = np.abs(given) / np.array([1.0, 1.0 / T, T])  # in units of P
        size = np.maximum(size, LEAST_GAIN_SHARE * size.max()) * np.array([1.0, 1.0 / T, T])
        units = tuple(float(each) for each in size)
        return cls((units[0], units[1], units[2]), leak), np.append(given / size, np.log(T))

    def system(self, x: RealArray) -> StateSpace:
        import control

        P, integral, D = x[:3] * self.gains
        T = float(np.exp(x[3]))
        # D s / (T s + 1) = D / T - (D / T) / (T s + 1)
        A = np.diag([-self.leak, -1.0 / T])
        return control.ss(A, [[1.0], [1.0 / T]], [[integral, -D / T]], [[P + D / T]])

    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        s, T = 1j * omega, np.exp(x[3])
        P, integral, D = self.gains
        lag = s / (T * s + 1)
        K = x[0] * P + x[1] * integral / (s + self.leak) + x[2] * D * lag
        slopes = [
            np.full_like(s, P),
            integral / (s + self.leak),
            D * lag,
            -x[2] * D * T * lag**2,
        ]
        return K[:, None, None], np.stack(slopes, axis=1)[:, :, None, None]

    def parameters(self, K: StateSpace) -> RealArray:
        import control

        poles = np.sort(K.poles().real)
        if (K.noutputs, K.ninputs, K.nstates) != (1, 1, 2) or K.dt:
            raise InputError(
                f"the controller has {K.ninputs} inputs, {K.noutputs} outputs and {K.nstates} "
                "states; a PID one has one, one and two, so that neither I nor D may be zero: give "
                "a small gain"
            )
        if abs(-poles[1] - self.leak) > ROOT_TOLERANCE * max(abs(poles[0]), self.leak):
            raise InputError(f"the controller's slow pole is {poles[1]}, the family's {-self.leak}")
        T = -1.0 / poles[0]
        G = control.ss(K)
        # Values of K at three points determine P, I and D.
        s = 1j / T * np.array([0.3, 1.0, 3.0])
        basis = np.stack([np.ones_like(s), 1 / (s + self.leak), s / (T * s + 1)], axis=1)
        values = np.array([complex(G(each)) for each in s])
        both = np.linalg.lstsq(
            np.vstack([basis.real, basis.imag]), np.append(values.real, values.imag), rcond=None
        )[0]
        return np.append(both / self.gains, np.log(T))

    def units(self, x: RealArray) -> RealArray:
        return np.ones_like(x)


@dataclass(frozen=True)
class Decentralised(Family):
    """A diagonal K: a controller with one input and one output for each channel.

    Examples
    --------
    >>> from workbench.synthesis import PID, Decentralised
    >>> family, x = Decentralised.of([PID.of(2.0, 1.0, 0.1, 0.01)] * 2)
    >>> family.counts, family.system(x).ninputs
    ((4, 4), 2)
    """

    channels: tuple[Family, ...]
    counts: tuple[int, ...]

    @classmethod
    def of(cls, members: Sequence[tuple[Family, RealArray]]) -> tuple[Decentralised, RealArray]:
        """The family and its parameters from families and parameters as their `of` gives them."""
        families, parts = zip(*members, strict=True)
        return cls(tuple(families), tuple(len(x) for x in parts)), np.concatenate(parts)

    def _split(self, x: RealArray) -> list[RealArray]:
        """The parameters of each channel."""
        return np.split(x, np.cumsum(self.counts)[:-1])

    def system(self, x: RealArray) -> StateSpace:
        import control

        parts = zip(self.channels, self._split(x), strict=True)
        return control.append(*(family.system(part) for family, part in parts))

    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        n = len(self.channels)
        K = np.zeros((len(omega), n, n), complex)
        slopes = np.zeros((len(omega), len(x), n, n), complex)
        at = 0
        for i, (family, part) in enumerate(zip(self.channels, self._split(x), strict=True)):
            K[:, i : i + 1, i : i + 1], own = family.response(part, omega)
            slopes[:, at : at + len(part), i : i + 1, i : i + 1] = own
            at += len(part)
        return K, slopes

    def parameters(self, K: StateSpace) -> RealArray:
        n = len(self.channels)
        if (K.noutputs, K.ninputs) != (n, n):
            raise InputError(f"the controller must have {n} inputs and outputs")
        return np.concatenate(
            [family.parameters(_channel(K, i)) for i, family in enumerate(self.channels)]
        )

    def units(self, x: RealArray) -> RealArray:
        parts = zip(self.channels, self._split(x), strict=True)
        return np.concatenate([family.units(part) for family, part in parts])


def _channel(K: StateSpace, i: int) -> StateSpace:
    """One diagonal element of K without the states of the others; InputError for a coupled K."""
    import control

    for j in range(K.ninputs):
        off = control.minreal(K[i, j], verbose=False)
        if j != i and (off.nstates or np.abs(off.D).max() > 0):
            raise InputError(f"output {i} of the controller answers input {j}: it is not diagonal")
    return control.minreal(K[i, i], verbose=False)
