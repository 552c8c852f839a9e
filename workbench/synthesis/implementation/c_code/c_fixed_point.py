"""C code of cascades in fixed-point arithmetic: inputs and outputs are integers.

Anti-windup and a start without a bump change the past outputs of last sections. The part of a
control that saturation removes is subtracted from these outputs, in equal shares if several
channels lead to the control.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from workbench.errors import InputError
from workbench.synthesis.implementation.c_code.counts import Counts, Limited
from workbench.synthesis.implementation.fixed_point import (
    ACCUMULATOR_BITS,
    FixedCascade,
    FixedPoint,
)
from workbench.synthesis.implementation.working_point.actuator import Actuator

PLACES = 4
"""Number of values in the memory of a section."""

_FRAME = """\
/* Controller in second-order sections, fixed point.
 *
 * {inputs} inputs, {outputs} outputs, sample time {time} s.
 * Measurements are integers over {scale}, 1 being full scale: y = {guard}_FULL_SCALE corresponds to
 * {y_scale} units. Controls are the same over full scales of {u_scale} units, and are limited to
 * {within}; the last sections are told of it (anti-windup). Coefficients have {bits} bits, signals
 * {signal_bits}; no section overflows. Call {name}_init once, then {name}_step each sample. Right
 * shifts of negative integers must be arithmetic, as they are with every common compiler.
{called} */
#ifndef {guard}_H
#define {guard}_H

#include <stdint.h>

#define {guard}_INPUTS {inputs}
#define {guard}_OUTPUTS {outputs}
#define {guard}_SAMPLE_TIME {time}
#define {guard}_FULL_SCALE {largest}

typedef struct {{
    int64_t x[{room}];
{memory}}} {name}_state;
{helpers}
static inline void {name}_init({name}_state *state)
{{
    for (int i = 0; i < {room}; i++)
        state->x[i] = 0;
{rest}}}

static inline void {name}_step({name}_state *state, {signals},
                               int32_t u[{outputs}])
{{
    int64_t *x = state->x, v, w, sum;
{step}}}

/* The state from which a step answers the measurements y with the controls u, but for roundings: no
 * bump. All other sections stand still then. A memory that would go beyond full scale stops there.
 */
static inline void {name}_start({name}_state *state, {signals},
                                const int32_t u[{outputs}])
{{
    int64_t *x = state->x, v, sum;
{start}}}

#endif
"""


def fixed_header(
    fixed: FixedPoint,
    bits: int,
    signal_bits: int,
    scales: tuple[float, float],
    name: str = "controller",
    actuator: Actuator | None = None,
) -> str:
    """Text of a C99 header of cascades in fixed point, for measurements with `signal_bits` bits.

    Parameters
    ----------
    fixed, bits, signal_bits
        Result of `fixed_point`, in which no section overflows, and its numbers of bits; at most 32
        for signals.
    scales
        Full scales of measurements and of controls.
    actuator
        Limits within the full scales of the controls, and the working point, from which signals are
        then counted.

    Raises
    ------
    InputError
        A section may overflow, signals have more than 32 bits, or sums need more than 64.
    """
    if not fixed.overflow_free:
        raise InputError(
            "a section may overflow: take more bits of signals; an integrator overflows where "
            "several measurements lead to its control"
        )
    if signal_bits > 32:
        raise InputError(f"signals have {signal_bits} bits; C code is for at most 32")

    def limited(value: str) -> str:
        return f"{name}_limited({value})"

    inputs, outputs = fixed.quantised.ninputs, fixed.quantised.noutputs
    period = float(fixed.quantised.dt)
    counts = Counts(actuator or Actuator(), scales, signal_bits, name, (inputs, outputs), period)
    step, start = counts.bounds + counts.errors, counts.start
    place = 0
    for i, line in enumerate(fixed.cascades):
        channels = []
        for cascade in line:
            channels.append(_sections(cascade, place, signal_bits))
            place += PLACES * len(channels[-1])
        step += _step_lines(i, channels, counts.limited(i))
        start += _start_lines(i, channels, limited, counts.input)
    return _FRAME.format(
        inputs=inputs,
        outputs=outputs,
        time=repr(period),
        scale=f"2^{signal_bits - 1}",
        name=name,
        guard=name.upper(),
        y_scale=f"{scales[0]:.9g}",
        u_scale=f"{scales[1]:.9g}",
        bits=bits,
        signal_bits=signal_bits,
        largest=2 ** (signal_bits - 1) - 1,
        room=place,
        step="".join(f"    {line}\n" for line in step + counts.kept + counts.approached),
        start="".join(f"    {line}\n" for line in start + counts.kept),
        **counts.places,
    )


@dataclass(frozen=True)
class _Section:
    """A section whose sums are in units of 2**-exponent. From `place` on, its memory holds two past
    inputs and two past outputs.

    The section passes on its output divided by 2**shift.
    """

    b: tuple[int, ...]
    a: tuple[int, ...]
    exponent: int
    shift: int
    place: int

    @property
    def memory(self) -> list[str]:
        return [f"x[{self.place + n}]" for n in range(PLACES)]

    def output(self) -> str:
        """The rounded output for the input v."""
        (b0, b1, b2), (a1, a2), (v1, v2, w1, w2) = self.b, self.a, self.memory
        terms = f"({b0} * v + {b1} * {v1} + {b2} * {v2} - {a1} * {w1} - {a2} * {w2})"
        return _shift_text(terms, -self.exponent)

    def resting_output(self) -> str:
        """The output that stays constant while the input is constantly v."""
        return f"{sum(self.b)} * v / {2**self.exponent + sum(self.a)}"

    def past_output(self, wanted: str) -> str:
        """The value for both past outputs after which a constant input v gives the output
        `wanted`.
        """
        return f"({sum(self.b)} * v - {2**self.exponent} * {wanted}) / {sum(self.a)}"


def _sections(cascade: FixedCascade, place: int, signal_bits: int) -> list[_Section]:
    """Sections of a channel; raises InputError if a sum needs more than 64 bits."""
    found = []
    for k, shift in enumerate(cascade.shifts):
        nb, na = int(cascade.numerator_exponents[k]), int(cascade.denominator_exponents[k])
        exponent = max(nb, na, 0)
        b = tuple(int(value) << (exponent - nb) for value in cascade.numerators[k])
        a = tuple(int(value) << (exponent - na) for value in cascade.denominators[k])
        room = 2 * (sum(map(abs, b)) + sum(map(abs, a)) + 2**exponent)
        if math.log2(room) + signal_bits - 1 >= ACCUMULATOR_BITS:
            raise InputError(
                f"section {k + 1} needs sums of more than 64 bits: take fewer bits, or scale "
                "signals"
            )
        found.append(_Section(b, a, exponent, int(shift), place + PLACES * k))
    return found


def _step_lines(i: int, channels: list[list[_Section]], limited: Limited) -> list[str]:
    """Lines of the step of output i: its sections, their sum, and the part that saturation
    removes.
    """
    lines = [*limited.bounds, "sum = 0;"]
    for j, sections in enumerate(channels):
        lines.append(f"v = {limited.input}[{j}];")
        last, alone = sections[-1], len(channels) == 1
        for section in sections:
            v1, v2, w1, w2 = section.memory
            output = section.output()
            lines += [
                f"w = {limited.last(output, alone, section.shift) if section is last else output};",
                f"{v2} = {v1}; {v1} = v; {w2} = {w1}; {w1} = w; v = w;",
            ]
        lines.append(f"sum += {_shift_text('v', sections[-1].shift)};")
    lines.append(f"u[{i}] = (int32_t){limited.control('sum')};")
    if len(channels) == 1:  # its last section stays within the limits of the control
        return lines
    lines.append(f"if (sum != u[{i}]) {{")
    for sections in channels:
        w1, shift = sections[-1].memory[2], sections[-1].shift
        lost = _shift_text(f"((sum - u[{i}]) / {len(channels)})", -shift)
        lines.append(f"    {w1} = {limited.full_scale(f'{w1} - {lost}')};")
    return [*lines, "}"]


def _start_lines(
    i: int, channels: list[list[_Section]], limited: Callable[[str], str], word: str
) -> list[str]:
    """Lines of the start of output i: one last section supplies what the others do not."""
    lasts = [sections[-1] for sections in channels]
    chosen = max(lasts, key=lambda last: abs(sum(last.a)) / 2**last.exponent)
    lines = [f"sum = u[{i}];"]
    for j in sorted(range(len(channels)), key=lambda j: lasts[j] is chosen):
        lines.append(f"v = {word}[{j}];")
        for section in channels[j]:
            v1, v2, w1, w2 = section.memory
            lines.append(f"{v1} = {v2} = v;")
            if section is not chosen:
                lines.append(f"v = {w1} = {w2} = {limited(section.resting_output())};")
        if lasts[j] is not chosen:
            lines.append(f"sum -= {_shift_text('v', lasts[j].shift)};")
    w1, w2 = chosen.memory[2:]
    if sum(chosen.a):
        wanted = limited(_shift_text("sum", -chosen.shift))
        lines.append(f"{w1} = {w2} = {limited(chosen.past_output(wanted))};")
    else:  # without a memory of outputs there is no state to set
        lines.append(f"{w1} = {w2} = 0; (void)sum;")
    return lines


def _shift_text(text: str, by: int) -> str:
    """An integer expression times a power of two; rounded where the power is negative."""
    if by >= 0:
        return f"{text} * {2**by}" if by else text
    return f"(({text} + {2 ** (-by - 1)}) >> {-by})"
