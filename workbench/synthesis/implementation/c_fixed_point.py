"""C code of cascades in fixed-point arithmetic: integers in, integers out, no rounding unseen."""

from __future__ import annotations

import numpy as np

from workbench.errors import InputError
from workbench.synthesis.implementation.fixed_point import (
    ACCUMULATOR_BITS,
    FixedCascade,
    FixedPoint,
)

_FRAME = """\
/* Controller in second-order sections, fixed point.
 *
 * {inputs} inputs, {outputs} outputs, sample time {time} s.
 * Measurements are integers over {scale}, 1 being full scale: y = {name}_FULL_SCALE corresponds to
 * {y_scale} units. Controls are the same over full scales of {u_scale} units, and are limited to
 * them. Coefficients have {bits} bits, signals {signal_bits}; no section overflows.
 * Call {name}_init once, then {name}_step each sample. Right shifts of negative integers must be
 * arithmetic, as they are with every common compiler.
 */
#ifndef {guard}_H
#define {guard}_H

#include <stdint.h>

#define {guard}_INPUTS {inputs}
#define {guard}_OUTPUTS {outputs}
#define {guard}_SAMPLE_TIME {time}
#define {guard}_FULL_SCALE {largest}

typedef struct {{
    int64_t x[{room}];
}} {name}_state;

static inline void {name}_init({name}_state *state)
{{
    for (int i = 0; i < {room}; i++)
        state->x[i] = 0;
}}

static inline void {name}_step({name}_state *state, const int32_t y[{inputs}],
                               int32_t u[{outputs}])
{{
    int64_t *x = state->x, v, a, sum;
{body}}}

#endif
"""


def fixed_header(
    fixed: FixedPoint,
    bits: int,
    signal_bits: int,
    scales: tuple[float, float],
    name: str = "controller",
) -> str:
    """Text of a C99 header of cascades in fixed point, for measurements of `signal_bits`.

    Parameters
    ----------
    fixed, bits, signal_bits
        From `fixed_point`, with no section that overflows; signals of at most 32 bits.
    scales
        Full scales of measurements and of controls, for the comment.

    Raises
    ------
    InputError
        A section may overflow, signals have more than 32 bits, or sums need more than 64.
    """
    if not fixed.overflow_free:
        raise InputError(
            "a section may overflow: take more bits of signals, or remove an integrator"
        )
    if signal_bits > 32:
        raise InputError(f"signals have {signal_bits} bits; C code is for at most 32")
    inputs, outputs = fixed.quantised.ninputs, fixed.quantised.noutputs
    largest = 2 ** (signal_bits - 1) - 1
    lines, place = [], 0
    for i, line in enumerate(fixed.cascades):
        lines.append("sum = 0;")
        for j, cascade in enumerate(line):
            lines.append(f"v = y[{j}];")
            for k in range(len(cascade.shifts)):
                lines += _section(cascade, k, place, signal_bits)
                place += 4
            shift = int(cascade.shifts[-1])
            lines.append(f"sum += {_shifted('v', shift)};")
        limited = f"sum > {largest} ? {largest} : sum < -{largest} ? -{largest} : sum"
        lines.append(f"u[{i}] = (int32_t)({limited});")
    return _FRAME.format(
        inputs=inputs,
        outputs=outputs,
        time=repr(float(fixed.quantised.dt)),
        scale=f"2^{signal_bits - 1}",
        name=name,
        guard=name.upper(),
        y_scale=f"{scales[0]:.9g}",
        u_scale=f"{scales[1]:.9g}",
        bits=bits,
        signal_bits=signal_bits,
        largest=largest,
        room=max(place, 1),
        body="".join(f"    {line}\n" for line in lines),
    )


def _section(cascade: FixedCascade, k: int, place: int, signal_bits: int) -> list[str]:
    """One section in direct form I; x holds its last two inputs and outputs."""
    b, a = cascade.numerators[k], cascade.denominators[k]
    nb, na = int(cascade.numerator_exponents[k]), int(cascade.denominator_exponents[k])
    exponent = max(nb, na, 0)
    room = (
        np.abs(b).sum() * 2.0 ** (exponent - nb) + np.abs(a).sum() * 2.0 ** (exponent - na)
    ) * 2.0
    if np.log2(max(room, 1.0)) + signal_bits - 1 >= ACCUMULATOR_BITS:
        raise InputError(
            f"section {k + 1} needs sums of more than 64 bits: take fewer bits, or scale signals"
        )
    x = [f"x[{place + n}]" for n in range(4)]
    forward = f"({b[0]} * v + {b[1]} * {x[0]} + {b[2]} * {x[1]})"
    back = f"({a[0]} * {x[2]} + {a[1]} * {x[3]})"
    return [
        f"a = {_shifted(forward, exponent - nb)} - {_shifted(back, exponent - na)};",
        f"a = (a + {2 ** (exponent - 1)}) >> {exponent};" if exponent else "",
        f"{x[1]} = {x[0]}; {x[0]} = v; {x[3]} = {x[2]}; {x[2]} = a; v = a;",
    ]


def _shifted(text: str, by: int) -> str:
    """An integer expression times a power of two; rounded where the power is negative."""
    if by >= 0:
        return f"{text} * {2**by}" if by else text
    return f"(({text} + {2 ** (-by - 1)}) >> {-by})"
