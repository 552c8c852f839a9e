"""Signals of fixed-point code: integers from the working point, and limits of the controls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.errors import InputError
from workbench.synthesis.implementation.c_code.call_comment import (
    CALLED,
    ascii_of,
    filter_init,
    filter_words,
)
from workbench.synthesis.implementation.working_point.actuator import Actuator
from workbench.synthesis.implementation.working_point.point import told

FILTER_BITS = 30
"""Bits of filtered set-points below a count. A difference of two counts of 32 bits, with these bits
below it, needs less than 64 bits.
"""

_CONVERTERS = """
/* Signals of the plant as integers, counted from the working point, and controls back. */
static inline int32_t {name}_from_y(int j, double y)
{{
    static const double rest[{inputs}] = {{{y_rest}}};
    return (int32_t){name}_limited((int64_t)((y - rest[j]) * {y_counts}));
}}

static inline int32_t {name}_from_u(int i, double u)
{{
    static const double rest[{outputs}] = {{{u_rest}}};
    return (int32_t){name}_limited((int64_t)((u - rest[i]) * {u_counts}));
}}

static inline double {name}_to_u(int i, int32_t u)
{{
    static const double rest[{outputs}] = {{{u_rest}}};
    return rest[i] + u / {u_counts};
}}
"""
_LIMITED = """
static inline int64_t {name}_limited(int64_t value)
{{
    const int64_t most = {guard}_FULL_SCALE;
    return value > most ? most : value < -most ? -most : value;
}}
"""
_WITHIN = """
static inline int64_t {name}_within(int64_t value, int64_t low, int64_t high)
{{
    return value > high ? high : value < low ? low : value;
}}
"""


@dataclass(frozen=True)
class Limited:
    """C expressions that limit values of output i: its sum, and the output of its last section."""

    name: str
    input: str
    bounds: list[str]

    def full_scale(self, value: str) -> str:
        """A value limited to full scale."""
        return f"{self.name}_limited({value})"

    def control(self, value: str) -> str:
        """A sum limited to the limits of the control."""
        return f"{self.name}_within({value}, low, high)" if self.bounds else self.full_scale(value)

    def last(self, value: str, alone: bool, shift: int) -> str:
        """The limited output of a last section; if its channel is `alone`, this output is the
        control.
        """
        if not (alone and self.bounds):
            return self.full_scale(value)
        # A section passes on its output divided by a power of two, so its limits are larger by this
        # power.
        low, high = (f"{side} * {2**-shift}" if shift < 0 else side for side in ("low", "high"))
        return self.full_scale(f"{self.name}_within({value}, {low}, {high})")


@dataclass(frozen=True)
class Counts:
    """The integers of a header. Full scale of y and of u is 2**(signal_bits - 1) counts."""

    actuator: Actuator
    scales: tuple[float, float]
    signal_bits: int
    name: str
    sizes: tuple[int, int]
    period: float

    @property
    def full(self) -> int:
        """The largest integer."""
        return int(2 ** (self.signal_bits - 1) - 1)

    @property
    def input(self) -> str:
        """Name of the array of the controller's inputs."""
        return "e" if self.actuator.point else "y"

    @cached_property
    def limits(self) -> list[tuple[int, int]] | None:
        """Limits of the controls within their full scale, rounded inwards."""
        bounds = self.actuator.deviations
        if bounds is None:
            return None
        one = 2.0 ** (self.signal_bits - 1) / self.scales[1]
        found = []
        for low, high in zip(*bounds, strict=True):
            least, most = (
                max(math.ceil(low * one), -self.full),
                min(math.floor(high * one), self.full),
            )
            if least >= most:
                raise InputError(
                    "the limits of the controls lie beyond their full scale, or within one of its "
                    f"steps, {1 / one:.3g}: take another full scale or more signal_bits"
                )
            found.append((least, most))
        return found

    @cached_property
    def change(self) -> list[int] | None:
        """Largest change of each control in a sample, rounded down."""
        if self.actuator.step is None:
            return None
        one = 2.0 ** (self.signal_bits - 1) / self.scales[1]
        found = [min(math.floor(step * one), self.full) for step in self.actuator.step]
        if min(found) < 1:
            raise InputError(
                f"rate_limit allows less than a step of the control, {1 / one:.3g}, in a sample: "
                "take more signal_bits"
            )
        return found

    @property
    def errors(self) -> list[str]:
        """The lines that compute errors from set-points and measurements, limited to full scale."""
        if self.actuator.point is None:
            return []
        one = "r[{0}] - (int64_t)y[{0}]" if self.actuator.sign < 0 else "y[{0}] - (int64_t)r[{0}]"
        inputs = self.sizes[0]
        lines: list[str] = []
        if self.actuator.approach is not None:
            one += " + apart[{0}]" if self.actuator.sign < 0 else " - apart[{0}]"
            rounded = []
            for j in range(inputs):
                change = f"((int64_t)state->setpoint[{j}] - r[{j}]) * {2**FILTER_BITS}"
                lines += [f"state->apart[{j}] += {change};", f"state->setpoint[{j}] = r[{j}];"]
                rounded.append(f"(state->apart[{j}] + {2 ** (FILTER_BITS - 1)}) >> {FILTER_BITS}")
            lines.append(f"const int64_t apart[{inputs}] = {{{', '.join(rounded)}}};")
        errors = [f"{self.name}_limited({one.format(j)})" for j in range(inputs)]
        return [*lines, f"const int64_t e[{inputs}] = {{{', '.join(errors)}}};"]

    @property
    def start(self) -> list[str]:
        """The lines that compute the errors of a start; filtered set-points begin at the
        measurements, so there are none.
        """
        if self.actuator.approach is None:
            return self.errors
        lines = []
        for j in range(self.sizes[0]):
            apart = f"((int64_t)y[{j}] - r[{j}]) * {2**FILTER_BITS}"
            lines += [f"state->setpoint[{j}] = r[{j}];", f"state->apart[{j}] = {apart};"]
        return [*lines, f"const int64_t e[{self.sizes[0]}] = {{0}};"]

    @property
    def bounds(self) -> list[str]:
        """The line that declares the bounds of a control, if it has any."""
        return ["int64_t low, high;"] if self.actuator.bounded else []

    @property
    def kept(self) -> list[str]:
        """The lines that keep the controls for the next sample."""
        count = self.sizes[1] if self.change is not None else 0
        return [f"state->before[{i}] = u[{i}];" for i in range(count)]

    @property
    def approached(self) -> list[str]:
        """The lines by which filtered set-points approach the set-points."""
        shares = () if self.actuator.approach is None else self.actuator.approach
        return [
            f"state->apart[{j}] -= {round(share * 2**FILTER_BITS)} * apart[{j}];"
            for j, share in enumerate(shares)
        ]

    def limited(self, i: int) -> Limited:
        """The expressions that limit values of output i."""
        lines: list[str] = []
        if self.actuator.bounded:
            low, high = (-self.full, self.full) if self.limits is None else self.limits[i]
            lows, highs = str(low), str(high)
            if self.change is not None:
                ends = (f"state->before[{i}] {sign} (int64_t){self.change[i]}" for sign in "-+")
                lows, highs = (f"{self.name}_within({end}, {low}, {high})" for end in ends)
            lines = [f"low = {lows};", f"high = {highs};"]
        return Limited(self.name, self.input, lines)

    @property
    def places(self) -> dict[str, str]:
        """The texts that fill the frame of a header."""
        (inputs, outputs), point, name = self.sizes, self.actuator.point, self.name
        guard = name.upper()
        one = f"const int32_t y[{inputs}]"
        signals = one if point is None else f"const int32_t r[{inputs}],\n{' ' * 31}{one}"
        helpers = _LIMITED.format(name=name, guard=guard)
        helpers += _WITHIN.format(name=name) if self.actuator.bounded else ""
        memory = rest = called = ""
        if self.change is not None:
            memory = f"    int32_t before[{outputs}];\n"
            rest = f"    for (int i = 0; i < {outputs}; i++)\n        state->before[i] = 0;\n"
        if self.actuator.approach is not None:
            memory += f"    int32_t setpoint[{inputs}];\n    int64_t apart[{inputs}];\n"
            rest += filter_init(inputs, "0")
        if point is not None:
            full = 2.0 ** (self.signal_bits - 1)
            y_counts, u_counts = (f"{full / scale!r}" for scale in self.scales)
            helpers += _CONVERTERS.format(
                name=name, inputs=inputs, outputs=outputs, y_counts=y_counts, u_counts=u_counts,
                y_rest=_row(point.y), u_rest=_row(point.u),
            )  # fmt: skip
            words = {
                "u": ascii_of(told(point.u, point.u_unit)),
                "y": ascii_of(told(point.y, point.y_unit)),
            }
            called = CALLED["counts"].format(name=name, **words)
            called += filter_words(self.actuator, self.period)
        within = "them" if self.limits is None else self._words()
        return {
            "signals": signals, "helpers": helpers, "memory": memory, "rest": rest,
            "called": called, "within": within,
        }  # fmt: skip

    def _words(self) -> str:
        assert self.actuator.lowest is not None and self.actuator.highest is not None
        pairs = zip(self.actuator.lowest, self.actuator.highest, strict=True)
        return "them and to " + ", ".join(f"{low:.6g} to {high:.6g}" for low, high in pairs)


def _row(values: tuple[float, ...]) -> str:
    return ", ".join(repr(float(value)) for value in np.array(values))
