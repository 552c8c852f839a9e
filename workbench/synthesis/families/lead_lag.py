"""PI with lead and roll-off, as a product of factors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import need_whole
from workbench.synthesis.families.family import (
    LARGEST_LOG,
    POLE_ROOM,
    Family,
    need_leak,
    need_size,
)

SPREADS, SMALL_GAIN = (1.0, 10.0), 1e-2
"""Factors between the corners of examples, and the gain of examples relative to the given gain."""
ROOT_TOLERANCE = 1e-6
"""Relative distance within which a root counts as real, and a pole as the fixed pole of a
family.
"""


@dataclass(frozen=True, kw_only=True)
class LeadLag(Family):
    """PI with lead and roll-off as a product of factors, with one input and one output.

        K(s) = sign g (s + z_1) ... (s + z_m) / ((s + leak) (s + p_1) ... (s + p_n)),

    with g, z and p positive. The parameters are log g, log z and log p. For m = n = 2 these roots
    are the zero of the PI part, zero and pole of the lead, and the roll-off. ``leak`` [rad/s] is
    the size of the fixed pole of the integrator. ``sign`` is 1 or -1; None takes the sign of a
    start.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.synthesis import LeadLag
    >>> family, x = LeadLag.of(control.tf([3.0, 3.0], [1.0, 10.1, 1.0]))
    >>> np.exp(x).round(4).tolist(), round(family.leak, 4)
    ([3.0, 1.0, 10.0], 0.1)
    """

    leak: float = 0.0
    zeros: int = 2
    poles: int = 2
    sign: float | None = None

    def __post_init__(self) -> None:
        need_leak(self.leak)
        need_whole(self.zeros, "zeros")
        need_whole(self.poles, "poles")
        if not 0 <= self.zeros <= self.poles + 1:
            raise InputError(
                f"{self.zeros} zeros and {self.poles} poles beside the leak; K must be proper: at "
                "most one zero more than those poles, and neither number below 0"
            )
        if self.sign not in (None, 1, -1):
            raise InputError(f"sign is {self.sign!r}; it must be 1, -1 or None")

    @classmethod
    def of(cls, controller: Any) -> tuple[LeadLag, RealArray]:
        """The family that contains a controller, and the controller's parameters.

        The controller's roots must be real and not right of the imaginary axis; its slowest pole is
        the leak. Raises InputError for other controllers.
        """
        import control

        controller = control.ss(controller)
        if (controller.noutputs, controller.ninputs) != (1, 1) or controller.dt:
            raise InputError("a lead-lag controller has one input, one output and continuous time")
        zeros, poles = np.sort_complex(controller.zeros()), np.sort_complex(controller.poles())
        roots = np.concatenate([zeros, poles])
        if (
            not len(poles)
            or (np.abs(roots.imag) > ROOT_TOLERANCE * np.abs(roots)).any()
            or roots.real.max() > 0
        ):
            raise InputError(
                f"the controller has zeros {zeros} and poles {poles}; they must be real and not "
                "right of the imaginary axis, and there must be at least one pole"
            )
        leak, fast = -poles.real[-1], -poles.real[:-1]
        s = 1j * float(np.exp(np.mean(np.log(np.append(fast, 1.0)))))
        value = complex(controller(s)) * (s + leak) * np.prod(s + fast) / np.prod(s - zeros.real)
        family = cls(
            leak=float(leak), zeros=len(zeros), poles=len(fast), sign=float(np.sign(value.real))
        )
        x = np.log(np.concatenate([[abs(value)], -zeros.real[::-1], fast[::-1]]))
        return family, x

    def system(self, x: RealArray) -> StateSpace:
        import control

        zeros, poles = self._roots(x)
        K = control.ss([], [], [], [[self._gain(x)]])
        for k, pole in enumerate(poles):
            direct, left = (1.0, zeros[k] - pole) if k < len(zeros) else (0.0, 1.0)
            K = control.ss(-pole, 1.0, left, direct) * K
        return K

    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        s = 1j * omega[:, None]
        zeros, poles = self._roots(x)
        K = self._gain(x) * (s + zeros).prod(axis=1) / (s + poles).prod(axis=1)
        logs = np.hstack([np.ones_like(s), zeros / (s + zeros), -poles[1:] / (s + poles[1:])])
        return K[:, None, None], (K[:, None] * logs)[:, :, None, None]

    def about(self, controller: StateSpace) -> tuple[LeadLag, RealArray]:
        family = self if self.sign else replace(self, sign=LeadLag.of(controller)[0].sign)
        return family, family.parameters(controller)

    def sized(self, inputs: int, outputs: int) -> LeadLag:
        need_size(
            self, (1, 1), inputs, outputs, "Decentralised(LeadLag(), LeadLag()) has two channels"
        )
        return self

    def halfspaces(self, stable: bool, fastest: float | None) -> tuple[RealArray, RealArray]:
        if fastest is None:
            return np.zeros((0, self.count)), np.zeros(0)
        rows = np.eye(self.count)[1 + self.zeros :]
        return rows, np.full(self.poles, np.log(fastest * (1.0 - POLE_ROOM)))

    @property
    def count(self) -> int:
        return 1 + self.zeros + self.poles

    def examples(self, omega: float, gain: float) -> Sequence[StateSpace]:
        signs = (1.0, -1.0) if self.sign is None else (self.sign,)
        found = []
        for spread in SPREADS:
            zeros = omega / spread * np.geomspace(0.1, 1.0, max(self.zeros, 1))[: self.zeros]
            poles = omega * spread * np.geomspace(3.0, 10.0, max(self.poles, 1))[: self.poles]
            # the gain for which |K| is small at omega
            size = SMALL_GAIN * gain * omega * np.prod(poles) / omega**self.zeros
            x = np.log(np.concatenate([[size], zeros, poles]))
            found += [replace(self, sign=sign).system(x) for sign in signs]
        return found

    def settings(self, controller: StateSpace) -> Mapping[str, float]:
        family, x = self.about(controller)
        zeros, poles = family._roots(x)
        fixed = {"gain": family._gain(x)}
        moved = {f"zero {k} [rad/s]": float(-z) for k, z in enumerate(np.sort(zeros), start=1)}
        return (
            fixed
            | moved
            | {f"pole {k} [rad/s]": float(-p) for k, p in enumerate(np.sort(poles), start=1)}
        )

    @property
    def _sign(self) -> float:
        """The sign; positive as long as no start has given it."""
        return self.sign or 1.0

    def parameters(self, controller: StateSpace) -> RealArray:
        family, x = LeadLag.of(controller)
        near = abs(family.leak - self.leak) <= ROOT_TOLERANCE * max(self.leak, family.leak)
        if not near or (family.zeros, family.poles, family.sign) != (
            self.zeros,
            self.poles,
            self._sign,
        ):
            raise InputError(f"the controller belongs to {family}, not to {self}")
        return x

    def units(self, x: RealArray) -> RealArray:
        return np.ones_like(x)

    def _gain(self, x: RealArray) -> float:
        return self._sign * float(_sizes(x[:1])[0])

    def _roots(self, x: RealArray) -> tuple[RealArray, RealArray]:
        """Magnitudes [rad/s] of the zeros, and of the poles with the leak first."""
        zeros, poles = np.split(_sizes(x[1:]), [self.zeros])
        return zeros, np.concatenate([[self.leak], poles])


def _sizes(logs: RealArray) -> RealArray:
    """Exponentials of logarithms, limited so that they do not overflow."""
    return np.exp(np.clip(logs, -LARGEST_LOG, LARGEST_LOG))
