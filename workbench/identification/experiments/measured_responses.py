"""Reading of measured frequency responses: complex numbers, two parts, or magnitude and phase."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

import numpy as np

from workbench._core.arrays import ComplexArray
from workbench._core.heavy_types import Dataset
from workbench.errors import InputError
from workbench.identification.experiments.records import asked_names, column, picked
from workbench.identification.files.columns import Columns
from workbench.identification.files.units import converted
from workbench.identification.files.variables import File, read_table

PART = re.compile(r"(?i)(?<![a-z])(re|real|im|imag\w*)(?![a-z])")
MAGNITUDE = re.compile(r"(?i)mag|gain|abs|ampl|modulus|betrag|\|.*\|")
PHASE = re.compile(r"(?i)(?<![a-z])(ph|arg)(?![a-z])|phas|angle|∠")
"""Patterns for names of phases, magnitudes, real and imaginary parts."""
Kind = Literal["magnitude", "phase", "part"]
ROLES: tuple[Literal["magnitude", "phase"], ...] = ("magnitude", "phase")
DECIBELS = ("db", "decibel", "decibels")


def read_response(file: File, frequency: str, response: str | tuple[str, str]) -> Dataset:
    r"""Read a measured frequency response from a file.

    Parameters
    ----------
    file
        A file that `read_variables` reads; Touchstone has the variables ``f``, ``S11``, ``S21``.
    frequency
        Name of the variable with the frequencies. The unit is the one stated in the file
        (``f_kHz``, ``w [rad/s]``, a row of units); otherwise Hz, or rad/s for a variable called
        omega, w or ω.
    response
        Name of a complex variable, (F,) or (F, outputs, inputs), which may hold texts such as
        ``1+2i``; or names of its real and its imaginary part; or of its magnitude and its phase,
        which are recognised by their names (``Magnitude (dB)``, ``gain``, ``phase [deg]``) or
        units.

    Returns
    -------
    Dataset
        ``response`` (frequency, output, input); its attribute ``read`` says how the file was
        interpreted.

    Raises
    ------
    InputError
        As `read_record`; or a phase without unit; or two names that are neither two parts nor
        magnitude and phase.

    Examples
    --------
    >>> from pathlib import Path
    >>> from workbench.identification import read_response
    >>> _ = Path("curve.csv").write_text("f [kHz],re,im\n1,1.0,0.0\n2,0.5,-0.5\n")
    >>> found = read_response("curve.csv", "f", ("re", "im"))
    >>> found["frequency"].values.tolist(), found["response"].values.ravel().tolist()
    ([1000.0, 2000.0], [(1+0j), (0.5-0.5j)])
    >>> _ = Path("bode.csv").write_text("f_Hz,Gain (dB),Phase (deg)\n1,20,90\n2,0,180\n")
    >>> found = read_response("bode.csv", "f_Hz", ("Gain (dB)", "Phase (deg)"))
    >>> found["response"].values.ravel().round(9).tolist()
    [10j, (-1+0j)]
    """
    import xarray as xr

    table = read_table(file)
    asked_names(frequency, "frequency")
    names = asked_names(response, "response")
    if len(names) > 2:
        raise InputError(f"{file}: a response has one name or two, not {len(names)}")
    hertz, how = table.hertz(table.own_name(frequency, "frequency"))
    if len(names) == 1:
        parts = {names[0]: _complex_column(table, names[0])}
    else:
        parts = {name: column(table, name) for name in names}
    found, _ = picked(table, {frequency: hertz} | parts)
    frequencies = found[frequency].ravel()
    values, formed = _response_of_parts(table, names, [found[name] for name in names])
    if values.size == len(frequencies):
        values = values.reshape(-1, 1, 1)
    if values.ndim != 3 or len(values) != len(frequencies):
        raise InputError(
            f"{file}: the response has shape {values.shape}, {len(frequencies)} frequencies need "
            f"({len(frequencies)},) or ({len(frequencies)}, outputs, inputs)"
        )
    unit = {"units": "Hz", "long_name": "frequency"}
    return xr.Dataset(
        {"response": (("frequency", "output", "input"), values, {"units": "1"})},
        coords={"frequency": ("frequency", frequencies, unit)},
        attrs={"read": "; ".join(filter(None, [table.said, how, formed]))},
    )


def _complex_column(table: Columns, name: str) -> np.ndarray:
    """A variable that may hold complex numbers, or texts of such; InputError for a magnitude."""
    own = table.own_name(name)
    values = table.complex_numbers(own) if own in table.texts else column(table, name)
    if not np.iscomplexobj(values) and (kind := _kind(table, name)) != "part":
        raise InputError(
            f"{table.path}: {name!r} is a {kind} alone: name magnitude and phase, or both parts"
        )
    return values


def _kind(table: Columns, name: str) -> Kind:
    """The kind of a column of real numbers, by its unit and its name."""
    own = {role: table.own_name(name, role) for role in ROLES}
    if PART.search(name):
        return "part"
    unit = table.unit(own["magnitude"], "magnitude")
    if unit is not None and unit.lower() in DECIBELS:
        return "magnitude"
    if table.unit(own["phase"], "phase") in ("deg", "rad", "°", "degrees", "radians"):
        return "phase"
    words = {"magnitude": MAGNITUDE, "phase": PHASE}
    return next((role for role in ROLES if words[role].search(own[role])), "part")


def _response_of_parts(
    table: Columns, names: Sequence[str], parts: Sequence[np.ndarray]
) -> tuple[ComplexArray, str]:
    """A complex response from its two parts, with a sentence on how it was formed."""
    if len(parts) == 1:
        return np.asarray(parts[0], dtype=complex), ""
    one, two = parts
    if one.shape != two.shape:
        raise InputError(f"{table.path}: {' and '.join(map(repr, names))} differ in shape")
    kinds = [_kind(table, name) for name in names]
    if kinds == ["magnitude", "phase"]:
        return _polar(table, names, parts)
    if kinds == ["part", "part"]:
        return one + 1j * two, f"{names[0]!r} and {names[1]!r} taken as real and imaginary part"
    raise InputError(
        f"{table.path}: {names[0]!r} is a {kinds[0]} and {names[1]!r} a {kinds[1]}: name two that "
        "belong together, real part and imaginary part, or magnitude and phase, in this order"
    )


def _polar(
    table: Columns, names: Sequence[str], parts: Sequence[np.ndarray]
) -> tuple[ComplexArray, str]:
    """A response from its magnitude, in decibels or not, and its phase."""
    magnitude, phase = parts
    own = table.own_name(names[0], "magnitude"), table.own_name(names[1], "phase")
    unit = table.unit(own[0], "magnitude")
    decibels = unit is not None and unit.lower() in DECIBELS
    if not decibels and (magnitude < 0).any():
        raise InputError(
            f"{table.path}: magnitude {names[0]!r} is negative: if it is in decibels, call it "
            f"'{names[0]} [dB]'"
        )
    turn = table.unit(own[1], "phase")
    if turn is None:
        raise InputError(
            f"{table.path}: the unit of phase {names[1]!r} is unknown: call it '{names[1]} [deg]' "
            f"or '{names[1]} [rad]'"
        )
    try:
        radians = converted(phase, turn, "rad")
    except InputError as error:
        raise InputError(f"{table.path}: phase {names[1]!r}: {error}") from None
    size = 10 ** (magnitude / 20) if decibels else magnitude
    values: ComplexArray = np.asarray(size * np.exp(1j * radians), dtype=complex)
    said = f"magnitude {names[0]!r} in {'dB' if decibels else unit or '1 (no unit known)'}"
    return values, f"{said}, phase {names[1]!r} in {turn}"
