"""C99 headers of sampled controllers with any number of inputs and outputs, without allocation."""

from __future__ import annotations

import math
import re
from typing import Any, Literal, get_args

import numpy as np

from workbench.errors import InputError
from workbench.synthesis.implementation.c_code.c_state_space import (
    anti_windup_gain,
    start_code,
    step_code,
)
from workbench.synthesis.implementation.c_code.call_comment import CALLED, how_called
from workbench.synthesis.implementation.second_order import Sections
from workbench.synthesis.implementation.working_point.actuator import Actuator
from workbench.systems.conversion import as_system

Precision = Literal["double", "float"]
"""C types of the numbers."""

_FRAME = """\
/* {what}
 *
 * {inputs} inputs, {outputs} outputs, {states} states, sample time {time} s.
{called} * {limited}
 */
#ifndef {guard}_H
#define {guard}_H

#define {guard}_INPUTS {inputs}
#define {guard}_OUTPUTS {outputs}
#define {guard}_STATES {states}
#define {guard}_SAMPLE_TIME {time}

typedef {real} {name}_real;

typedef struct {{
    {name}_real x[{room}];
{memory}}} {name}_state;

{tables}
static inline void {name}_init({name}_state *state)
{{
    for (int i = 0; i < {room}; i++)
        state->x[i] = 0;
{rest}}}

static inline void {name}_step({name}_state *state, {signals},
                               {name}_real u[{outputs}])
{{
{body}{clip}}}
{start}
#endif
"""
_START = """\

/* The state from which a step answers {the_signals} with the controls u: no bump. */
static inline void {name}_start({name}_state *state, {signals},
                                const {name}_real u[{outputs}])
{{
{moves}}}
"""
_CASCADES = """\
    /* Transposed direct form II; x holds two values a section. */
    {name}_real *x = state->x;
    const {name}_real (*row)[5] = {name}_sections;
    for (int i = 0; i < {outputs}; i++) {{
        u[i] = 0;
        for (int j = 0; j < {inputs}; j++) {{
            {name}_real v = y[j];
            for (int k = 0; k < {name}_counts[i][j]; k++, row++, x += 2) {{
                const {name}_real w = (*row)[0] * v + x[0];
                x[0] = (*row)[1] * v - (*row)[3] * w + x[1];
                x[1] = (*row)[2] * v - (*row)[4] * w;
                v = w;
            }}
            u[i] += v;
        }}
    }}
"""
_CLIP = """\
    for (int i = 0; i < {outputs}; i++) {{
        if (u[i] < {name}_lowest[i])
            u[i] = {name}_lowest[i];
        else if (u[i] > {name}_highest[i])
            u[i] = {name}_highest[i];
    }}
"""


def header(
    K: Any,
    name: str = "controller",
    precision: Precision = "double",
    actuator: Actuator | None = None,
) -> str:
    """Text of a C99 header that defines ``name_state``, ``name_init`` and ``name_step``.

    For a state space there is also ``name_start``, with which the controller takes over from
    another one without a bump.

    Parameters
    ----------
    K
        Sampled StateSpace or TransferFunction, computed in its own state coordinates, or
        `Sections`.
    name
        Prefix of every name in the header, a C identifier.
    actuator
        Limits to which the outputs are clipped. The states of a state space take the limits into
        account (anti-windup, see `anti_windup_gain`); those of sections do not. With a working
        point, which only a state space can have, signals are in the user's units.

    Raises
    ------
    InputError
        The controller is continuous; the precision cannot hold a number; or the name or the limits
        are wrong.
    """
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise InputError(f"name is {name!r}; it must be a C identifier that starts with a letter")
    if not (isinstance(precision, str) and precision in get_args(Precision)):
        raise InputError(f'precision is {precision!r}; it must be "double" or "float"')
    if isinstance(K, Sections):
        states, dt = 2 * sum(len(rows) for line in K.channels for rows in line), K.dt
    else:
        K = _sampled(K)
        states, dt = K.nstates, K.dt
    act = actuator or Actuator()
    places = {
        "name": name,
        "guard": name.upper(),
        "real": precision,
        "inputs": K.ninputs,
        "outputs": K.noutputs,
        "states": states,
        "room": max(states, 1),  # C does not allow arrays of length 0
        "time": repr(float(dt)),
    }
    places |= how_called(act, places)
    tables: dict[str, Any]
    if isinstance(K, Sections):
        what, body, start = "second-order sections", _CASCADES.format(**places), ""
        clip = _CLIP.format(**places) if act.bounded else ""
        tables = _cascade_tables(K) | _actuator_tables(act)
        told = "which the states do not see"
    else:
        what, clip, tables = "state space", "", _actuator_tables(act)
        H = anti_windup_gain(K) if act.bounded else None

        def number(value: float) -> str:
            return _number(value, precision)

        body = step_code(K, name, number, H, act)
        start = _START.format(moves=start_code(K, name, number, act), **places)
        told = "of which the states are told (anti-windup)"
    constants = "".join(
        f"static const {'int' if values.dtype == int else f'{name}_real'} {name}_{key}"
        f"{''.join(f'[{size}]' for size in values.shape)} = {_text(values, precision)};\n"
        for key, values in tables.items()
    )
    return _FRAME.format(
        what=f"Controller in {what}.",
        limited=f"Outputs are clipped to limits, {told}." if act.bounded else CALLED["free"],
        tables=constants,
        body=body,
        clip=clip,
        start=start,
        **places,
    )


def _actuator_tables(actuator: Actuator) -> dict[str, Any]:
    """Tables of limits, of the largest change in a sample, and of the signals at rest."""
    point, filtered = actuator.point, actuator.approach is not None
    found = {
        "lowest": actuator.lowest,
        "highest": actuator.highest,
        "change": actuator.step,
        "rest": None if point is None else np.array(point.u),
        "rest_y": np.array(point.y) if point is not None and filtered else None,
    }
    return {key: values for key, values in found.items() if values is not None}


def _sampled(K: Any) -> Any:
    """K as a StateSpace; raises InputError unless it has a sampling time."""
    K = as_system(K, "K")
    if not K.dt or K.dt is True:
        raise InputError(
            f"K {K.name!r} has dt = {K.dt}; a computer needs a controller with a sampling time in "
            "seconds: use discretised()"
        )
    return K


def _cascade_tables(K: Sections) -> dict[str, Any]:
    """Tables of the coefficients of all sections, and of the number of sections of each channel."""
    rows = np.vstack([rows for line in K.channels for rows in line])
    counts = np.array([[len(rows) for rows in line] for line in K.channels], dtype=int)
    return {"sections": rows[:, [0, 1, 2, 4, 5]], "counts": counts}


def _text(values: Any, precision: str) -> str:
    """A C initialiser with decimals that give exactly the same numbers."""
    if values.ndim > 1:
        lines = ",\n".join(f"    {_text(row, precision)}" for row in values)
        return f"{{\n{lines}\n}}"
    return f"{{{', '.join(_number(value, precision) for value in values)}}}"


def _number(value: Any, precision: str) -> str:
    """A C literal; raises InputError for a number that the precision cannot hold."""
    if isinstance(value, np.integer):
        return str(int(value))
    kind, suffix = (np.float64, "") if precision == "double" else (np.float32, "f")
    with np.errstate(over="ignore", under="ignore"):
        near = kind(value)
    if not math.isfinite(near) or (near == 0.0) != (value == 0.0):
        raise InputError(f"the controller has the number {value}, which {precision} cannot hold")
    return f"{near!s}{suffix}"
