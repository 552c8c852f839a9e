"""The controller that a C header computes, read back from its text."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certificate import THIS_SYSTEM, Check

NUMBER = r"-?\d+"
SECTION = re.compile(
    rf"\(({NUMBER}) \* v \+ ({NUMBER}) \* x\[\d+\] \+ ({NUMBER}) \* x\[\d+\] "
    rf"- ({NUMBER}) \* x\[\d+\] - ({NUMBER}) \* x\[\d+\]\)(?: \+ \d+\) >> (\d+))?"
)
"""The integer sum of a section in the code, and the number of bits by which it is shifted back."""
PRINTED_ROUNDING = 1e-12
"""Relative change of a double by printing and reading."""
SHARE_ROUNDING = 1e-4
"""Largest relative change of the share of a set-point filter by a number format."""


def code_agrees(text: str, K: Any, kind: type) -> Check:
    """Check that a header for a state space computes K, with its numbers in a format."""
    read = state_space_of(text)
    own = np.block([[K.A, K.B], [K.C, K.D]])
    if read.shape != own.shape:
        apart = np.inf
    else:
        off = np.abs(read.astype(kind).astype(float) - own)
        apart = float(np.max(off / np.maximum(np.abs(own), np.finfo(kind).tiny), initial=0.0))
    statement = "largest difference of a coefficient in the code from the controller's, relative"
    return Check("code", statement, apart, PRINTED_ROUNDING, over=THIS_SYSTEM)


def integer_code_agrees(text: str, channels: Any) -> Check:
    """Check that a header for integers computes the cascades ``channels[i][j]`` (L, 6)."""
    rows = [row for line in channels for cascade in line for row in cascade]
    gains = section_gains(text)
    apart, number = (0.0 if len(gains) == len(rows) else np.inf), 0
    for line in channels:
        for cascade in line:
            # Each section gives its output divided by a power of two; the last one undoes that.
            found = np.array(gains[number : number + len(cascade)])
            number += len(cascade)
            if len(found) != len(cascade):
                continue
            apart = max(apart, float(np.abs(found[:, 3:] - cascade[:, 4:]).max(initial=0.0)))
            product, wanted = np.ones(1), np.ones(1)
            for one, other in zip(found, cascade, strict=True):
                product, wanted = np.convolve(product, one[:3]), np.convolve(wanted, other[:3])
            scale = _last_shift(text, number)
            apart = max(apart, float(np.abs(scale * product - wanted).max(initial=0.0)))
    statement = "largest difference of a coefficient in the code from the controller's"
    return Check("code", statement, apart, PRINTED_ROUNDING, over=THIS_SYSTEM)


def state_space_of(text: str) -> RealArray:
    """[A B; C D] of the step in a header for a state space, without its limits."""
    inputs, outputs, states = (_defined(text, name) for name in ("INPUTS", "OUTPUTS", "STATES"))
    body = _step(text)
    lines = re.findall(r"^\s*(state->x\[\d+\]|u\[\d+\]) = ([^;]*);$", body, re.MULTILINE)
    sums = dict(reversed(lines))  # limits come after the sum that they limit
    word = "e" if re.search(r"\be\[\d+\] = ", body) else "y"  # differences from the user's signals
    names = [f"x{i}" for i in range(states)] + [f"{word}[{j}]" for j in range(inputs)]
    targets = [f"state->x[{i}]" for i in range(states)] + [f"u[{i}]" for i in range(outputs)]
    found = np.zeros((len(targets), len(names)))
    for row, target in enumerate(targets):
        for value, name in _terms(sums.get(target, "0")):
            if name in names:
                found[row, names.index(name)] += value
    return found


def section_gains(text: str) -> list[list[float]]:
    """b0 b1 b2 a1 a2 of each section in the step of a header for integers."""
    found = []
    for *numbers, shift in SECTION.findall(_step(text)):
        found.append([int(number) / 2.0 ** int(shift or 0) for number in numbers])
    return found


def absolute_signals_agree(text: str, wanted: dict[str, Any], kind: type) -> Check:
    """Check that a header's tables of limits, changes and controls at rest have the wanted values
    (p,).

    The names of the tables are the keys of ``wanted``; None: there must be no such table. The step
    must add controls at rest, and must use limits.
    """
    body, apart = _step(text), 0.0
    for name, values in wanted.items():
        table = re.search(rf"\w+_{name}\[\d+\] = \{{([^}}]*)\}};", text)
        if values is None or table is None:
            apart = max(apart, 0.0 if values is None and table is None else np.inf)
            continue
        read = np.array([float(one.rstrip("f")) for one in table.group(1).split(", ")])
        own = np.asarray(values, dtype=float).astype(kind).astype(float)
        used = [f"_{name}[{i}]" in body for i in range(len(own))]
        off = np.abs(read.astype(kind) - own) if read.shape == own.shape and all(used) else np.inf
        apart = max(apart, float(np.max(off / np.maximum(np.abs(own), np.finfo(kind).tiny))))
    statement = "largest difference of a limit or a control at rest in the code, relative"
    return Check("absolute signals", statement, apart, PRINTED_ROUNDING, over=THIS_SYSTEM)


def setpoint_filter_agrees(text: str, decays: Any) -> Check:
    """Check that the step shrinks the distances of filtered set-points by these factors (m,).

    The code subtracts a share of each distance, integers in units of 2**-30. Without factors there
    must be no such line.
    """
    pattern = r"state->apart\[(\d+)\] -= (\S+) \* (state->)?apart\[\1\];"
    read = np.array([
        float(share.rstrip("f")) * (1.0 if real else 2.0**-30)
        for _, share, real in re.findall(pattern, _step(text))
    ])  # fmt: skip
    wanted = 1.0 - np.asarray(decays, dtype=float)
    off = np.abs(read - wanted) / wanted if read.shape == wanted.shape else np.inf
    statement = "largest difference of a filter's share of distance in the code, relative"
    apart = float(np.max(off, initial=0.0))
    return Check("set-point filter", statement, apart, SHARE_ROUNDING, over=THIS_SYSTEM)


def _terms(text: str) -> list[tuple[float, str]]:
    """Factors and names of a sum of products."""
    found = re.findall(
        r"([+-] )?(-?[\d.eE+-]+)f? \* ([a-z]\d+|[ye]\[\d+\]|\(u\[\d+\] - w\d+\))", text
    )
    return [
        (float(f"{sign.strip()}{value}".replace("--", "")), name) for sign, value, name in found
    ]


def _last_shift(text: str, count: int) -> float:
    """The factor of a cascade's output, after ``count`` sections of the step."""
    place = list(SECTION.finditer(_step(text)))[count - 1].end()
    found = re.search(r"sum \+= (.*);", _step(text)[place:])
    written = found.group(1) if found else "v"
    if times := re.fullmatch(r"v \* (\d+)", written):
        return float(times.group(1))
    back = re.fullmatch(r"\(\(v \+ \d+\) >> (\d+)\)", written)
    return 2.0 ** -int(back.group(1)) if back else 1.0


def _step(text: str) -> str:
    """The body of the step."""
    start = re.search(r"static inline void \w+_step\(", text)
    assert start is not None
    return text[text.index("{", start.end()) : text.index("\n}\n", start.end())]


def _defined(text: str, name: str) -> int:
    found = re.search(rf"#define \w+_{name} (\d+)", text)
    return int(found.group(1)) if found else 0
