"""Reading of records and responses from CSV, MAT and NetCDF files into labelled datasets.

Every error names the file and the line or the variable.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from workbench.arrays import RealArray
from workbench.errors import InputError
from workbench.heavy_types import Dataset
from workbench.identification.experiments.signals import SECONDS
from workbench.identification.experiments.text_table import IN_BRACKETS, Columns
from workbench.identification.experiments.variables import File, read_table
from workbench.input_checks import as_list, need_positive


def read_record(
    file: File,
    inputs: Sequence[str],
    outputs: Sequence[str],
    sample_rate: float | None = None,
    time: str | None = None,
) -> Dataset:
    r"""Read a record of inputs and outputs from a file.

    Parameters
    ----------
    file
        A file that `read_variables` reads.
    inputs, outputs
        Names of variables, without their units if the file has them in brackets. A variable with
        several columns gives several channels; ``"y[0]"`` is the first of them.
    sample_rate
        Sampling frequency [Hz].
    time
        Name of a variable with equidistant instants [s], instead of ``sample_rate``.

    Returns
    -------
    Dataset
        ``u`` (input, time) and ``y`` (output, time); the attribute ``read`` says what was found
        out to read the file. Rows in which every variable asked for is blank are left out.

    Raises
    ------
    InputError
        The file cannot be read; a variable is missing, contains NaN or differs in length; or the
        instants are not equidistant.

    Examples
    --------
    >>> from pathlib import Path
    >>> from workbench.identification import read_record
    >>> _ = Path("log.csv").write_text("time,u,y\n0.0,1.0,0.0\n0.1,1.0,0.5\n0.2,1.0,0.7\n")
    >>> record = read_record("log.csv", inputs=["u"], outputs=["y"], time="time")
    >>> record["y"].values.tolist(), record.sizes["time"]
    ([[0.0, 0.5, 0.7]], 3)
    """
    import xarray as xr

    if (sample_rate is None) == (time is None):
        raise InputError(f"{file}: give either the sample rate or the name of the time variable")
    if sample_rate is not None:
        need_positive(sample_rate, "sample_rate")
    table = read_table(file)
    asked = {"input": _names(inputs, "inputs"), "output": _names(outputs, "outputs")}
    names = [*asked["input"], *asked["output"], *([] if time is None else _names(time, "time"))]
    picked, rows = _picked(file, table, names)
    signals = {channel: _channels(file, picked, names, channel) for channel, names in asked.items()}
    lengths = {values.shape[1] for _, values in signals.values()}
    if len(lengths) > 1:
        raise InputError(f"{file}: inputs and outputs differ in length: {sorted(lengths)} samples")
    count = lengths.pop()
    if time is None:
        instants = np.arange(count) / sample_rate
    else:
        instants = picked[time].ravel() * _factor(file, table, time, SECONDS)
        steps = np.diff(instants)
        if len(instants) != count or count < 2 or not steps[0] > 0:
            raise InputError(f"{file}: variable {time!r} needs {count} rising instants")
        # Instants in text files are rounded, so deviations up to a tenth of a step are accepted.
        apart = np.abs(steps - steps.mean()) > 0.1 * steps.mean()
        if apart.any():
            raise InputError(
                f"{file}: variable {time!r} is not equidistant at sample {np.argmax(apart) + 1}, "
                f"{uneven(table, rows, instants)}: resample the record or cut it there"
            )
    arrays = {}
    for name, channel in (("u", "input"), ("y", "output")):
        units = dict.fromkeys(
            table.units.get(name_in_file(table, each), "1") for each in asked[channel]
        )
        words = {"units": next(iter(units)) if len(units) == 1 else "1", "long_name": f"{channel}s"}
        arrays[name] = ((channel, "time"), signals[channel][1], words)
    coords = {channel: labels for channel, (labels, _) in signals.items()}
    unit = {"units": "s", "long_name": "time"}
    step = (instants[-1] - instants[0]) / max(count - 1, 1)
    read = f"{table.said}; {count} samples, {step:.6g} s apart"
    return xr.Dataset(
        arrays, coords={"time": ("time", instants, unit), **coords}, attrs={"read": read}
    )


def read_response(file: File, frequency: str, response: str | tuple[str, str]) -> Dataset:
    r"""Read a measured frequency response from a file.

    Parameters
    ----------
    file
        A file that `read_variables` reads.
    frequency
        Name of the variable with the frequencies [Hz], or another unit that the file names.
    response
        Name of a complex variable, (F,) or (F, outputs, inputs), or names of its real and its
        imaginary part.

    Returns
    -------
    Dataset
        ``response`` (frequency, output, input); the attribute ``read`` says what was found out.

    Examples
    --------
    >>> from pathlib import Path
    >>> from workbench.identification import read_response
    >>> _ = Path("curve.csv").write_text("f [kHz],re,im\n1,1.0,0.0\n2,0.5,-0.5\n")
    >>> found = read_response("curve.csv", "f", ("re", "im"))
    >>> found["frequency"].values.tolist(), found["response"].values.ravel().tolist()
    ([1000.0, 2000.0], [(1+0j), (0.5-0.5j)])
    """
    import xarray as xr

    table = read_table(file)
    names = [*_names(frequency, "frequency"), *_names(response, "response")]
    picked, _ = _picked(file, table, names)
    frequencies = picked[frequency].ravel() * _factor(file, table, frequency, HERTZ)
    if isinstance(response, str):
        values = np.asarray(picked[response], dtype=complex)
    else:
        real, imaginary = (picked[name] for name in response)
        if real.shape != imaginary.shape:
            raise InputError(f"{file}: {' and '.join(map(repr, response))} differ in shape")
        values = real + 1j * imaginary
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
        attrs={"read": table.said},
    )


HERTZ = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "rad/s": 1 / (2 * np.pi), "1/s": 1.0}
COLUMN = re.compile(r"(.+)\[(\d+)\]")
"""A column of a matrix, such as ``y[0]``."""


def _names(names: str | Sequence[str], called: str) -> list[str]:
    """Names of variables, at least one; raises InputError for what are none."""
    found = [names] if isinstance(names, str) else as_list(names, called)
    if not found or not all(isinstance(name, str) for name in found):
        raise InputError(f"{called} is {names!r}; names of variables are needed")
    return found


def _factor(file: File, table: Columns, name: str, known: Mapping[str, float]) -> float:
    """What a variable is multiplied with: its unit, where the file tells one."""
    unit = table.units.get(name_in_file(table, name))
    if unit is None or unit in known:
        return 1.0 if unit is None else known[unit]
    raise InputError(
        f"{file}: {name!r} is in {unit!r}; {', '.join(known)} are known: write another unit there"
    )


def name_in_file(table: Columns, name: str) -> str:
    """The name of a variable as the file has it: with its unit, if that is in brackets."""
    if name in table.variables:
        return name
    found = [
        own for own in table.variables if (split := IN_BRACKETS.fullmatch(own)) and split[1] == name
    ]
    return found[0] if len(found) == 1 else name


def uneven(table: Columns, rows: Sequence[int], instants: RealArray) -> str:
    """Where instants (N,) step least like the others, N rows of a table; in words."""
    steps = np.diff(instants)
    usual = np.median(steps)
    worst = int(np.argmax(np.abs(steps - usual)))
    return (
        f"{table.place(rows[worst + 1])}: a step of {steps[worst]:.6g} where the usual one is "
        f"{usual:.6g}"
    )


def _picked(
    file: File, table: Columns, names: Sequence[str]
) -> tuple[dict[str, np.ndarray], Sequence[int]]:
    """Variables by name, without the rows in which all are blank, and the rows of the table left.

    All are finite, or it raises `InputError`.
    """
    found: dict[str, np.ndarray] = {}
    for name in names:
        own, column = name_in_file(table, name), COLUMN.fullmatch(name)
        if own in table.variables:
            found[name] = table.variables[own]
        elif column and column[1] in table.variables:
            matrix = np.atleast_2d(table.variables[column[1]])
            columns = matrix if len(matrix) < matrix.shape[1] else matrix.T
            if int(column[2]) >= len(columns):
                raise InputError(f"{file}: {column[1]!r} has {len(columns)} columns, no {name!r}")
            found[name] = columns[int(column[2])]
        elif name in table.texts:
            raise InputError(f"{file}: variable {name!r} has no numbers: {table.texts[name]}")
        else:
            raise InputError(
                f"{file} has no variable {name!r}; it has {', '.join(table.variables) or 'none'}"
                f" ({table.said})"
            )
    shapes = {values.shape for values in found.values()}
    rows: Sequence[int] = range(max(len(values) for values in found.values()))
    if len(shapes) == 1 and len(next(iter(shapes))) == 1:
        blank = np.all([np.isnan(values) for values in found.values()], axis=0)
        found = {name: values[~blank] for name, values in found.items()}
        rows = np.flatnonzero(~blank).tolist() if blank.any() else rows
    for name, values in found.items():
        wrong = ~np.isfinite(values)
        if wrong.any():
            row, *others = (int(i) for i in np.argwhere(wrong)[0])
            place = ", ".join([table.place(rows[row]), *map(str, others)])
            raise InputError(
                f"{file}: variable {name!r} has {wrong.sum()} entries that are blank, NaN or "
                f"infinite, the first at {place}: fill the gaps, cut the record there, or take "
                "read_variables, which keeps them, and fits that take missing outputs"
            )
    return found, rows


def _channels(
    file: File, variables: Mapping[str, np.ndarray], names: Sequence[str], kind: str
) -> tuple[list[str], np.ndarray]:
    """Labels and samples (channels, N) of the channels in the variables of given names."""
    labels: list[str] = []
    rows: list[np.ndarray] = []
    for name in names:
        values = variables[name]
        if values.ndim > 2 or values.ndim == 0 or np.iscomplexobj(values):
            raise InputError(f"{file}: variable {name!r} is no {kind}: it has shape {values.shape}")
        # Take the longer side as the samples, whether the file has rows or columns.
        table = np.atleast_2d(
            values.T if values.ndim == 2 and len(values) > values.shape[1] else values
        )
        labels += [name] if len(table) == 1 else [f"{name}[{i}]" for i in range(len(table))]
        rows += list(table.astype(float))
    lengths = {label: len(row) for label, row in zip(labels, rows, strict=True)}
    if len(set(lengths.values())) > 1:
        raise InputError(f"{file}: {kind}s differ in length: {lengths}")
    return labels, np.array(rows)
