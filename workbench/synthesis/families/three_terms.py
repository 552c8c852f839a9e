"""PID, PI and PD controllers, with set-point weights if the set-point is a measurement of its
own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import need_kind, need_positive
from workbench.synthesis.families.family import (
    LARGEST_LOG,
    POLE_ROOM,
    Family,
    need_leak,
    need_size,
)
from workbench.synthesis.families.least_squares import combined
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import realisation

ROOT_TOLERANCE = 1e-6
"""Relative distance within which a pole counts as the fixed pole of a family."""
MEMBER_TOLERANCE = 1e-6
"""Relative distance of responses within which a controller is a member."""
FILTERS = tuple(np.geomspace(1e-3, 1.0, 13))
"""Filter time constants tried in the search for the nearest member, times the most important
frequency.
"""
AS_NEAR = 1e-6
"""Distances with a smaller relative difference count as equal; of filters with equal distance the
slowest is taken.
"""
FAST_FILTER = 10.0
"""Corner of an example's filter relative to the other corners."""


@dataclass(frozen=True, kw_only=True)
class ThreeTerms(Family):
    """Base of PID, PI and PD controllers: a sum of terms with gains of any sign.

    The parameters are the gains named in ``terms``, then log T if the filter is free, then the
    gains of the set-point if there are set-point weights.
    """

    terms: ClassVar[str]

    filter: float | None = None
    leak: float = 0.0
    setpoint_weights: bool = False

    def __post_init__(self) -> None:
        need_positive(self.filter, "filter", or_none=True)
        need_leak(self.leak)
        need_kind(self.setpoint_weights, bool, "setpoint_weights")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters: gains P, I and D, the filter T, and gains P_r and D_r of the
        set-point r.
        """
        free = "D" in self.terms and self.filter is None
        apart = [f"{each}_r" for each in self.terms if each != "I"] if self.setpoint_weights else []
        return (*self.terms, *(["T"] if free else []), *apart)

    @property
    def count(self) -> int:
        return len(self.names)

    def sized(self, inputs: int, outputs: int) -> Family:
        name = type(self).__name__
        do = f"Decentralised({name}(), {name}()) has one for each of two channels"
        if (inputs, outputs) == (2, 1):
            do = f"{name}(setpoint_weights=True) takes the set-point r and the output y, in order"
        if self.setpoint_weights and (inputs, outputs) == (1, 1):
            do = "leave out setpoint_weights, or measure the set-point r and the output y, in order"
        need_size(self, (1 + self.setpoint_weights, 1), inputs, outputs, do)
        return self

    def system(self, x: RealArray) -> StateSpace:
        gains, T = self._gains(x)
        P, D = (np.array([[gains.get(f"{name}_r", 0.0), -gains.get(name, 0.0)]]) for name in "PD")
        I = gains.get("I", 0.0)  # noqa: E741
        into = np.array([[1.0, -1.0]])
        if not self.setpoint_weights:
            P, D, into = -P[:, 1:], -D[:, 1:], np.ones((1, 1))
        poles, B, C = [], [], []
        if "I" in self.terms:
            poles, B, C = [-self.leak], [into], [I]
        if "D" in self.terms:
            # D s / (T s + 1) = D / T - (D / T) / (T s + 1)
            one = not self.setpoint_weights
            poles.append(-1.0 / T)
            B.append(into / T if one else D / T)
            C.append(-float(D[0, 0]) / T if one else -1.0 / T)
            P = P + D / T
        width = into.shape[1]
        matrices = (np.diag(poles).reshape(len(poles), -1), np.reshape(B, (-1, width)),
                    np.reshape(C, (1, -1)), P)  # fmt: skip
        return realisation(matrices, 0.0)

    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        (gains, T), s = self._gains(x), 1j * omega
        basis = self._basis(omega, T)
        K = sum(gains[name] * each for name, each in basis.items())
        slopes = []
        for name in self.names:
            if name == "T":  # T d/dT of s / (T s + 1)
                turned = (-T * s / (T * s + 1))[:, None, None]
                moved = [n for n in ("D", "D_r") if n in basis]
                slopes.append(sum(gains[n] * basis[n] * turned for n in moved))
            else:
                slopes.append(basis[name])
        return np.asarray(K, dtype=complex), np.stack(slopes, axis=1)

    def units(self, x: RealArray) -> RealArray:
        """Units: the sizes of the gains, and 1 for the logarithm of T."""
        return np.where([name == "T" for name in self.names], 1.0, np.abs(x))

    def halfspaces(self, stable: bool, fastest: float | None) -> tuple[RealArray, RealArray]:
        if fastest is None or "T" not in self.names:
            return np.zeros((0, self.count)), np.zeros(0)
        row = np.array([[-1.0 if name == "T" else 0.0 for name in self.names]])
        return row, np.array([np.log(fastest * (1.0 - POLE_ROOM))])

    def parameters(self, controller: StateSpace) -> RealArray:
        inputs = 1 + self.setpoint_weights
        if (
            (controller.noutputs, controller.ninputs) != (1, inputs)
            or controller.nstates > 2
            or controller.dt
        ):
            raise InputError(
                f"the controller has {controller.ninputs} inputs, {controller.noutputs} outputs "
                f"and {controller.nstates} states; a member of {self} has {inputs}, 1 and at most "
                "2, in continuous time"
            )
        T = self._filter_time_constant(controller)
        near = 1.0 / T if T else float(np.abs(controller.poles()).max(initial=0.0)) or 1.0
        omega = near * np.geomspace(1e-3, 3.0, 12)
        wanted = response(controller, omega)
        size = np.abs(wanted).max(axis=(1, 2))
        weight = 1.0 / np.where(size > 0, size, 1.0)
        x, miss = self._nearest_gains(wanted, omega, weight, T)
        if miss > MEMBER_TOLERANCE * np.sqrt(wanted.size):
            raise InputError(f"the controller is no member of {self}: no member has its response")
        return x

    def examples(self, omega: float, gain: float) -> Sequence[StateSpace]:
        x = np.zeros(self.count)
        if "T" in self.names:
            x[self.names.index("T")] = -np.log(FAST_FILTER * omega)
        return [self.system(x)]

    def nearest(
        self, controller: StateSpace, omega: RealArray, weight: RealArray
    ) -> StateSpace | None:
        """The nearest member: for each of many filters, linear least squares gives the gains."""
        wanted = response(controller, omega)
        filters = [self.filter or 0.0]
        if "T" in self.names:
            corner = float(np.exp(np.average(np.log(omega), weights=weight)))
            own = controller.poles()
            own = own[own.real < 0].real
            filters = sorted([each / corner for each in FILTERS] + (-1.0 / own).tolist())
        tried = [self._nearest_gains(wanted, omega, weight, T) for T in filters]
        size = float(np.linalg.norm(weight[:, None, None] * wanted))
        near = min(miss for _, miss in tried) + AS_NEAR * size
        return self.system([x for x, miss in tried if miss <= near][-1])

    def settings(self, controller: StateSpace) -> Mapping[str, float]:
        gains, T = self._gains(self.parameters(controller))
        found = {name: gains[name] for name in self.terms}
        if "D" in self.terms:
            found["T [s]"] = T
        for weight, name in (("b", "P"), ("c", "D")):
            if f"{name}_r" in gains and gains[name]:
                found[weight] = gains[f"{name}_r"] / gains[name]
        return found

    def _gains(self, x: RealArray) -> tuple[dict[str, float], float]:
        """The gains by name, and the time constant of the filter [s]."""
        gains = dict(zip(self.names, map(float, x), strict=True))
        log = gains.pop("T", None)
        return gains, (self.filter or 1.0) if log is None else float(
            np.exp(np.clip(log, -LARGEST_LOG, LARGEST_LOG))
        )

    def _basis(self, omega: RealArray, T: float) -> dict[str, ComplexArray]:
        """Responses (F, 1, m) that the gains multiply."""
        s = 1j * omega
        alone = {"P": np.ones_like(s), "I": 1.0 / (s + self.leak), "D": s / (T * s + 1)}
        signs = {"": [1.0]}
        if self.setpoint_weights:
            signs = {"": [0.0, -1.0], "_r": [1.0, 0.0]}
        found = {
            name + end: (alone[name][:, None] * np.array(sign))[:, None, :]
            for end, sign in signs.items()
            for name in self.terms
            if name + end != "I_r"
        }
        if self.setpoint_weights and "I" in found:
            found["I"] = (alone["I"][:, None] * np.array([1.0, -1.0]))[:, None, :]
        return found

    def _nearest_gains(
        self, wanted: ComplexArray, omega: RealArray, weight: RealArray, T: float
    ) -> tuple[RealArray, float]:
        """Parameters nearest to a response (F, 1, m) for this filter, and the remaining
        distance.
        """
        basis = self._basis(omega, T or 1.0)
        gains, miss = combined(np.stack(list(basis.values()), axis=1), wanted, weight)
        found = dict(zip(basis, gains, strict=True)) | {"T": np.log(T or 1.0)}
        return np.array([found[name] for name in self.names]), miss

    def _filter_time_constant(self, K: StateSpace) -> float:
        """Time constant [s] of a member's filter; 0 where it has none."""
        poles = np.sort(K.poles().real)
        fastest = float(np.abs(poles).max(initial=0.0))
        if "I" in self.terms and len(poles):
            place = int(np.argmin(np.abs(poles + self.leak)))
            if abs(poles[place] + self.leak) <= ROOT_TOLERANCE * max(fastest, self.leak):
                poles = np.delete(poles, place)
            elif len(poles) + ("D" not in self.terms) == 2:
                raise InputError(
                    f"the controller's slow pole is {poles[-1]}, but that of {self} is {-self.leak}"
                )
        if "D" not in self.terms:
            return 0.0
        if self.filter is not None:
            return self.filter
        if not len(poles) and len(K.A) and K.D.any() and K.C.any() and K.B.any():
            # D is zero, so any filter is right; take one that is fast compared with P / I
            rest = abs(complex(response(K - K.D, [1.0])[0, 0, -1]) * (1j + self.leak))
            return abs(float(K.D[0, -1])) / rest / FAST_FILTER
        if len(poles) != 1 or not poles[0] < 0:
            raise InputError(
                f"the controller has the poles {K.poles()}; one of them must be the filter of "
                f"the derivative: where D is zero give it a small gain, or {self} a filter"
            )
        return -1.0 / float(poles[0])


@dataclass(frozen=True, kw_only=True)
class PID(ThreeTerms):
    """K(s) = P + I / (s + leak) + D s / (T s + 1), with one input and one output.

    With ``setpoint_weights`` the inputs are the set-point r and the output y, and

        u = P (b r - y) + I / (s + leak) (r - y) + D s / (T s + 1) (c r - y).

    The parameters are P, I, D, log T unless the ``filter`` T [s] is given, and with set-point
    weights b P and c D. ``leak`` [rad/s] is the size of the integrator's pole, 0 for an exact one.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import PID
    >>> family, x = PID.of(P=2.0, I=1.0, D=0.1, T=0.01, leak=0.0)
    >>> bool(np.isclose(family.system(x)(2j), 2.0 + 1 / 2j + 0.1 * 2j / (0.01 * 2j + 1)))
    True
    >>> PID(filter=0.01, setpoint_weights=True).names
    ('P', 'I', 'D', 'P_r', 'D_r')
    """

    terms: ClassVar[str] = "PID"

    @classmethod
    def of(
        cls,
        P: float,
        I: float,  # noqa: E741
        D: float,
        T: float,
        *,
        leak: float = 0.0,
    ) -> tuple[PID, RealArray]:
        """The family with this leak of the integrator, and the parameters of the controller.

        `T` is the filter of the derivative [s], `leak` the size of the integrator's pole [rad/s].
        """
        given: list[Any] = [P, I, D]
        if not (np.isfinite(given).all() and 0.0 < T < np.inf and any(given)):
            raise InputError(
                f"P, I, D = {P}, {I}, {D} and T = {T}: gains must be finite and not all zero, T "
                "positive"
            )
        return PID(leak=leak), np.array([P, I, D, np.log(T)], dtype=float)


@dataclass(frozen=True, kw_only=True)
class PI(ThreeTerms):
    """K(s) = P + I / (s + leak), with one input and one output.

    With ``setpoint_weights`` the inputs are the set-point r and the output y, and

        u = P (b r - y) + I / (s + leak) (r - y).

    The parameters are P and I, and with set-point weights b P. ``leak`` [rad/s] is the size of the
    integrator's pole, 0 for an exact one.

    Examples
    --------
    >>> from workbench.synthesis import PI
    >>> K = PI().system([2.0, 1.0])
    >>> {name: round(gain, 9) for name, gain in PI().settings(K).items()}
    {'P': 2.0, 'I': 1.0}
    """

    terms: ClassVar[str] = "PI"
    filter: None = field(default=None, init=False, repr=False)


@dataclass(frozen=True, kw_only=True)
class PD(ThreeTerms):
    """K(s) = P + D s / (T s + 1), with one input and one output.

    With ``setpoint_weights`` the inputs are the set-point r and the output y, and

        u = P (b r - y) + D s / (T s + 1) (c r - y).

    The parameters are P, D, log T unless the ``filter`` T [s] is given, and with set-point weights
    b P and c D.

    Examples
    --------
    >>> from workbench.synthesis import PD
    >>> PD(filter=0.1).system([2.0, 1.0]).poles().tolist()
    [(-10+0j)]
    """

    terms: ClassVar[str] = "PD"
    leak: float = field(default=0.0, init=False, repr=False)
