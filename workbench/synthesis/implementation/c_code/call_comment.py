"""Use of a header: its comment, and the signals of its functions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from workbench.synthesis.implementation.working_point.actuator import Actuator
from workbench.synthesis.implementation.working_point.point import told

CALLED = {
    "free": "Outputs are not limited.",
    "plain": """\
 * Call {name}_init once, then {name}_step each sample: it reads y[{inputs}] and writes
 * u[{outputs}], which must not overlap. y are the inputs of the controller as it was designed:
 * in a loop with e = r - y the errors e, not the measurements.
""",
    "point": """\
 * Set-points r, measurements y and controls u are in the units of the plant, absolute. The design
 * holds about the working point u = {u}, y = {y}. At the start:
 *
 *     static {name}_state state;
 *     read y; r = y, or what is wanted; u = what the actuator has now;
 *     {name}_init(&state);
 *     {name}_start(&state, r, y, u);    no bump: the first step goes on from u
 *
 * Then every {time} s, in automatic:
 *
 *     read y; {name}_step(&state, r, y, u); give u to the actuator
 *
 * In manual call {name}_start in place of {name}_step, with the u of the operator.
""",
    "filter": """\
 * Set-points pass a filter of first order, with {times}, which begins at y.
""",
    "counts": """\
 *
 * Set-points r, measurements y and controls u are counted from the working point u = {u}, y = {y}:
 * {name}_from_y(j, y) and {name}_from_u(i, u) make counts of absolute signals, {name}_to_u(i, u)
 * makes a control of counts. At the start, and in manual with the u of the operator,
 * {name}_start(&state, r, y, u): no bump; in automatic {name}_step(&state, r, y, u) each sample.
""",
}
"""Texts of the comment."""


def how_called(actuator: Actuator, places: Mapping[str, Any]) -> dict[str, str]:
    """The comment on the use of a header, and the parameters of its functions."""
    name, inputs, outputs = places["name"], places["inputs"], places["outputs"]
    y = f"const {name}_real y[{inputs}]"
    rest = "0"
    called, signals, the_signals = CALLED["plain"].format(**places), y, "the measurements y"
    point = actuator.point
    if point is not None:
        words = {"u": told(point.u, point.u_unit), "y": told(point.y, point.y_unit)}
        words = {key: ascii_of(text) for key, text in words.items()}
        called = CALLED["point"].format(**places, **words)
        signals = f"const {name}_real r[{inputs}],\n{' ' * 31}{y}"
        the_signals, rest = "set-points r and measurements y", f"{name}_rest[i]"
    memory = init = ""
    if actuator.step is not None:
        memory = f"    {name}_real before[{outputs}];\n"
        init = f"    for (int i = 0; i < {outputs}; i++)\n        state->before[i] = {rest};\n"
    if actuator.approach is not None:
        memory += f"    {name}_real setpoint[{inputs}], apart[{inputs}];\n"
        init += filter_init(inputs, f"{name}_rest_y[j]")
    return {
        "called": called + filter_words(actuator, float(places["time"])),
        "signals": signals,
        "the_signals": the_signals,
        "memory": memory,
        "rest": init,
    }


def filter_init(inputs: int, rest: str) -> str:
    """Lines that let filtered set-points begin where the plant rests."""
    return (
        f"    for (int j = 0; j < {inputs}; j++) {{\n"
        f"        state->setpoint[j] = {rest};\n        state->apart[j] = 0;\n    }}\n"
    )


def filter_words(actuator: Actuator, period: float) -> str:
    """The line of the comment on the filter of the set-points; "" without one."""
    if actuator.approach is None:
        return ""
    times = ", ".join(f"{-period / np.log1p(-share):.6g} s" for share in actuator.approach)
    what = "a time constant of" if len(actuator.approach) == 1 else "time constants of"
    return CALLED["filter"].format(times=f"{what} {times}")


def ascii_of(text: str) -> str:
    """A unit in the characters that C allows."""
    plain = text.replace("°", "deg ").replace("µ", "u").replace("μ", "u").replace("Ω", "Ohm")
    return plain.encode("ascii", "replace").decode().replace("*/", "* /")
