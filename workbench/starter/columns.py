"""Find the columns of the time, the input and the output of a record by their names."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.experiments.records import uneven
from workbench.identification.files.columns import Columns
from workbench.identification.files.variables import read_table

TIME = ("t", "time", "zeit", "seconds", "timestamp")
INPUT = (
    "u", "in", "input", "torque", "force", "current", "voltage", "command", "reference", "drive",
    "excitation", "control", "valve", "pwm", "duty", "power", "heater", "pump",
)  # fmt: skip
OUTPUT = (
    "y", "out", "output", "position", "speed", "velocity", "angle", "place", "displacement",
    "acceleration", "gap", "temperature", "level", "pressure", "response", "sensor", "measured",
)  # fmt: skip
EVEN = 0.1
"""Largest relative deviation of the steps in a column that is taken as equidistant instants."""


def record_columns(
    file: Path,
    input: str | None,
    output: str | None,
    time: str | None,
    dt: float | None,
    excitation: str | int | None = None,
) -> tuple[str, str, str | None]:
    """Names of a record's columns for input, output and time; names that are given are kept.

    A column that is named as the excitation is none of them. The time is None if the sampling
    frequency is given. Raises InputError if the names do not settle which column is which; the
    message lists all names.
    """
    columns = read_table(file)
    asked = {"input": input, "output": output, "time": time}
    for kind, name in asked.items():
        if name is not None:
            asked[kind] = columns.own_name(name, "time" if kind == "time" else "signal")
    input, output, time = asked.values()
    if input is not None and input == output:
        raise InputError(f"{input!r} is named as the input and as the output: name two columns")
    table = columns.variables | _stamps(columns)
    names = [name for name, values in table.items() if np.ndim(values) == 1]
    told = f"{file} has the columns {', '.join(map(repr, table)) or 'none'}"
    if not columns.named:
        told = (
            f"{file} has numbers in its first line, {columns.place(0)}, and no names; its columns "
            f"are called {', '.join(map(repr, table))} until a line such as time,u,y stands there"
        )
    for kind, name in (("input", input), ("output", output), ("time", time)):
        if name is not None and name not in columns.names:
            raise InputError(f"{told}: none is called {name!r}; name the {kind}, --{kind} NAME")
    if time is None and dt is None:
        found = _instants(table, names)
        if not found:
            _refuse_gaps(file, columns, table, names)
        time = _only_name(found, told, "time", "or give --sample-rate HZ")
    if time is None and dt is not None:
        _need_rate(columns, _names_with_word(_instants(table, names), TIME), dt, told)
    driver = columns.own_name(excitation, "signal") if isinstance(excitation, str) else None
    left = [name for name in names if name not in (input, output, time, driver)]
    if input is None:
        fit = _names_with_word(left, INPUT)
        if not fit and output is not None and len(left) == 1:
            fit = left
        both = output is None and len(_names_with_word(left, OUTPUT)) != 1
        input = _only_name(fit, told, "input", "and the output, --output NAME" if both else "")
        left = [name for name in left if name != input]
    if output is None:
        output = _only_name(
            _names_with_word(left, OUTPUT) or (left if len(left) == 1 else []), told, "output"
        )
    return input, output, time


def _stamps(columns: Columns) -> dict[str, RealArray]:
    """The columns that hold dates or clock times, converted to [s]."""
    found = {}
    for name in list(columns.texts):
        with suppress(InputError):
            found[name] = columns.seconds(name)[0]
    return found


def _refuse_gaps(
    file: Path, columns: Columns, table: Mapping[str, np.ndarray], names: Sequence[str]
) -> None:
    """Raise InputError if a time column has gaps: it rises, and most steps are equal."""
    for name in _names_with_word(names, TIME) or names:
        rows = np.flatnonzero(np.isfinite(table[name])).tolist()
        instants = table[name][rows]
        steps = np.diff(instants)
        if steps.size < 2 or steps.min() <= 0:
            continue
        usual = np.median(steps)
        apart = np.abs(steps - usual) > EVEN * usual
        if 2 * apart.sum() <= steps.size:
            raise InputError(
                f"{file}: column {name!r} looks like the time, but {apart.sum()} of its "
                f"{steps.size} steps differ, most at {uneven(columns, rows, instants)}; rows seem "
                "to be missing. Interpolate the record at even instants, or cut it to a stretch "
                "without gaps; if only the instants are wrong, give --sample-rate HZ"
            )


def _need_rate(columns: Columns, called: Sequence[str], dt: float, told: str) -> None:
    """Raise InputError if a time column contradicts the given sampling frequency."""
    for name in called:
        rate = 1.0 / float(np.diff(columns.seconds(name)[0]).mean())
        if abs(rate * dt - 1) > EVEN:
            raise InputError(
                f"{told}; {name!r} rises by {1 / rate:.4g} s a sample, {rate:.6g} Hz, and "
                f"--sample-rate says {1 / dt:g} Hz: leave it out, or rename the "
                "column"
            )


def _only_name(found: Sequence[str], told: str, kind: str, also: str = "") -> str:
    """The name if exactly one was found; otherwise an InputError that says how to give it."""
    if len(found) == 1:
        return found[0]
    what = f"{', '.join(map(repr, found))} may be" if found else "none is seen to be"
    raise InputError(f"{told}; {what} the {kind}: name it, --{kind} NAME {also}".rstrip())


def _names_with_word(names: Sequence[str], words: Sequence[str]) -> list[str]:
    """The names that contain one of the words as a separate word."""
    return [name for name in names if set(re.split(r"[^a-z]+", name.lower())) & set(words)]


def _instants(table: dict[str, np.ndarray], names: Sequence[str]) -> list[str]:
    """The columns with rising, equidistant values.

    If there are several, those named like a time.
    """
    rising = []
    for name in names:
        steps = np.diff(table[name])
        if steps.size and np.isfinite(steps).all() and steps.min() > 0:
            mean = steps.mean()
            if np.abs(steps - mean).max() <= EVEN * mean:
                rising.append(name)
    return (_names_with_word(rising, TIME) or rising) if len(rising) > 1 else rising
