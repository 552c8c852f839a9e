"""Touchstone files of version 1: network parameters over frequency.

Source: IBIS Open Forum, Touchstone File Format Specification, version 2.0, 2009, which also states
version 1.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from workbench.errors import InputError
from workbench.identification.files.columns import Columns
from workbench.identification.files.encodings import decoded

TOUCHSTONE = re.compile(r"\.s(\d{1,2})p")
"""File endings of Touchstone; the number is that of the ports."""
HERTZ = {"hz": 1.0, "khz": 1e3, "mhz": 1e6, "ghz": 1e9}


def read_touchstone(path: Path) -> Columns:
    """Frequencies ``f`` [Hz] and complex parameters ``S11``, ``S21`` and so on (Y, Z, G, H too).

    Version 1 stores Z relative to the reference resistance and Y relative to its reciprocal; they
    are returned in ohms and siemens.

    Raises
    ------
    InputError
        The file is of version 2, or its numbers do not fill whole matrices; the message names the
        line.
    """
    ending = TOUCHSTONE.fullmatch(path.suffix.lower())
    ports = int(ending[1]) if ending else 0
    options, numbers = _parts(path)
    unit, kind, form, resistance = _options(path, options)
    width = 1 + 2 * ports**2
    rows = numbers[: len(numbers) // width * width].reshape(-1, width)
    falling = np.flatnonzero(np.diff(rows[:, 0]) <= 0)
    rows = rows[: falling[0] + 1] if falling.size else rows
    rest = numbers[rows.size :]
    noise = ports == 2 and len(rows) and rest.size % 5 == 0 and rest[:1] <= rows[-1, 0]
    if not len(rows) or (rest.size and not noise):
        raise InputError(
            f"{path} has {len(numbers)} numbers; rising frequencies with {ports}x{ports} "
            f"parameters each need multiples of {width}: is its ending that of its ports, or is "
            "its end torn?"
        )
    first, second = rows[:, 1::2], rows[:, 2::2]
    if form == "ri":
        values = first + 1j * second
    else:
        values = (10 ** (first / 20) if form == "db" else first) * np.exp(1j * np.radians(second))
    scale = {"z": resistance, "y": 1 / resistance}.get(kind, 1.0)
    places = [(i, j) for i in range(1, ports + 1) for j in range(1, ports + 1)]
    if ports == 2:  # only for two ports do the columns come first
        places.sort(key=lambda place: place[::-1])
    found = {
        f"{kind.upper()}{i}{j}" if ports < 10 else f"{kind.upper()}{i},{j}": scale * column
        for (i, j), column in zip(places, values.T, strict=True)
    }
    said = f"Touchstone, {ports} ports, {resistance:g} ohm"
    return Columns(path, {"f": rows[:, 0] * HERTZ[unit], **found}, {"f": "Hz"}, said=said)


def _parts(path: Path) -> tuple[str, np.ndarray]:
    """The option line, and all numbers after it."""
    options, numbers = "", []
    for place, line in enumerate(decoded(path).splitlines(), 1):
        words = line.partition("!")[0].strip()
        if words.startswith("["):
            raise InputError(f"{path}, line {place}: Touchstone of version 2: save it as version 1")
        if words.startswith("#"):
            options = options or words[1:]
            continue
        for word in words.split():
            try:
                number = float(word)
            except ValueError:
                number = np.nan
            if not np.isfinite(number):
                raise InputError(f"{path}, line {place}: {word!r} is not a finite number")
            numbers.append(number)
    return options, np.array(numbers)


def _options(path: Path, line: str) -> tuple[str, str, str, float]:
    """Unit of the frequencies, kind and format of the parameters, reference resistance."""
    words = line.lower().split()
    unit, kind, form, resistance = "ghz", "s", "ma", 50.0
    for place, word in enumerate(words):
        if word in HERTZ:
            unit = word
        elif word in ("s", "y", "z", "g", "h"):
            kind = word
        elif word in ("ri", "ma", "db"):
            form = word
        elif word == "r" and place + 1 < len(words):
            try:
                resistance = float(words[place + 1])
            except ValueError:
                resistance = 0.0
    if not 0 < resistance < np.inf:
        raise InputError(f"{path}: the options {line.strip()!r} name no positive resistance R")
    return unit, kind, form, resistance
