"""Reading of records from files of all formats into labelled datasets.

Every error names the file and the line or the variable.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset
from workbench.errors import InputError
from workbench.identification.files.columns import Columns
from workbench.identification.files.names import split_name
from workbench.identification.files.variables import File, read_table
from workbench.input_checks import as_list, need_positive


def read_record(
    file: File,
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    dt: float | None = None,
    time: str | None = None,
) -> Dataset:
    r"""Read a record of inputs and outputs from a file.

    Parameters
    ----------
    file
        A file that `read_variables` reads.
    inputs, outputs
        Names of variables, with or without the units that they contain, as in ``torque [Nm]``,
        ``torque/Nm`` and ``speed_rpm``. A variable with several columns gives several channels;
        ``"y[0]"`` is the first of them. Other columns are ignored.
    dt
        Sampling time [s].
    time
        Name of a variable with equidistant instants, instead of ``dt``. It may hold
        numbers in the unit stated by the file (``t_ms``, ``Time [h]``, a row of units; otherwise
        seconds), dates, or clock times such as ``23:59:59.5``, which may run past midnight.

    Returns
    -------
    Dataset
        ``u`` (input, time) and ``y`` (output, time). The attribute ``read`` says how the file was
        interpreted, ``assumed`` which units are unknown. Rows in which all these variables are
        blank are left out.

    Raises
    ------
    InputError
        The file cannot be read; a variable is missing, contains NaN or differs in length; the
        instants are not equidistant or are ambiguous; a unit is unknown or does not fit. The
        message names the file, the line or the variable, and what to do.

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

    if dt is not None and time is not None:
        raise InputError(f"{file}: give either dt or the name of the time variable, not both")
    if dt is not None:
        need_positive(dt, "dt")
    table = read_table(file)
    if dt is None and time is None:
        raise InputError(
            f"{file}: give either dt or the name of the time variable, one of "
            f"{', '.join(map(repr, table.names))}"
        )
    asked = {"input": asked_names(inputs, "inputs"), "output": asked_names(outputs, "outputs")}
    columns, units, told = _signals(table, [name for names in asked.values() for name in names])
    if time is not None:
        asked_names(time, "time")
        columns[time], how = table.seconds(table.own_name(time, "time"))
        told += [how] * bool(how)
    found, rows = picked(table, columns)
    signals = {channel: _channels(file, found, names, channel) for channel, names in asked.items()}
    lengths = {values.shape[1] for _, values in signals.values()}
    if len(lengths) > 1:
        raise InputError(f"{file}: inputs and outputs differ in length: {sorted(lengths)} samples")
    count = lengths.pop()
    if time is None:
        instants = np.arange(count) * dt
    else:
        instants = found[time].ravel()
        _need_even(table, time, instants, count, rows)
    arrays = {}
    for name, channel in (("u", "input"), ("y", "output")):
        own = {units[each] for each in asked[channel]}
        words = {"units": own.pop() if len(own) == 1 else "1", "long_name": f"{channel}s"}
        arrays[name] = ((channel, "time"), signals[channel][1], words)
    coords = {channel: labels for channel, (labels, _) in signals.items()}
    unit = {"units": "s", "long_name": "time"}
    step = (instants[-1] - instants[0]) / max(count - 1, 1)
    read = "; ".join([table.said, *told, f"{count} samples, {step:.6g} s apart"])
    return xr.Dataset(
        arrays,
        coords={"time": ("time", instants, unit), **coords},
        attrs={"read": read, "assumed": "; ".join(told)},
    )


def _need_even(
    table: Columns, name: str, instants: RealArray, count: int, rows: Sequence[int]
) -> None:
    """Raise InputError unless there are ``count`` instants that rise by equal steps."""
    steps = np.diff(instants)
    if len(instants) != count or count < 2:
        raise InputError(f"{table.path}: variable {name!r} needs {count} rising instants")
    if not steps.min() > 0:
        row = int(np.argmin(steps > 0)) + 1
        rounded = "; where its instants are only rounded, give dt instead" * bool(steps.min() == 0)
        raise InputError(
            f"{table.path}: variable {name!r} needs {count} rising instants, and falls or stays at "
            f"{table.place(rows[row])}: sort the rows, cut the record there, or name another column"
            f"{rounded}"
        )
    # Instants in text files are rounded, so deviations up to a tenth of a step are accepted.
    apart = np.abs(steps - steps.mean()) > 0.1 * steps.mean()
    if apart.any():
        raise InputError(
            f"{table.path}: variable {name!r} is not equidistant at "
            f"{uneven(table, rows, instants)}: resample the record or cut it there; where its "
            "instants are only rounded, give dt instead"
        )


EQUAL_STEPS = 1e-3
"""Relative difference of two irregular steps that is rounding."""
COLUMN = re.compile(r"(.+)\[(\d+)\]")
"""A column of a matrix, such as ``y[0]``."""


def asked_names(names: str | Sequence[str], called: str) -> list[str]:
    """A list of names of variables, at least one; raises InputError for anything else."""
    found = [names] if isinstance(names, str) else as_list(names, called)
    if not found or not all(isinstance(name, str) for name in found):
        raise InputError(f"{called} is {names!r}; names of variables are needed")
    return found


def uneven(table: Columns, rows: Sequence[int], instants: RealArray) -> str:
    """Text with the first most irregular step of instants (N,), given their N rows of a table."""
    steps = np.diff(instants)
    usual = np.median(steps)
    apart = np.abs(steps - usual)
    worst = int(np.argmax(apart > (1 - EQUAL_STEPS) * apart.max()))
    return (
        f"{table.place(rows[worst + 1])}: a step of {steps[worst]:.6g} where the usual one is "
        f"{usual:.6g}"
    )


def _signals(
    table: Columns, names: Sequence[str]
) -> tuple[dict[str, np.ndarray], dict[str, str], list[str]]:
    """Columns by name, converted to the unit in the name, if any; their units; assumptions."""
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    told = []
    for name in names:
        columns[name], unit = column(table, name), table.unit(table.own_name(name))
        asked = split_name(name)[1]
        if unit is not None and asked not in (None, unit):
            columns[name], unit = table.converted(columns[name], name, unit, asked), asked
        if unit is None:
            told.append(f"unit of {name!r} unknown, taken as 1")
        units[name] = unit or "1"
    return columns, units, told


def picked(
    table: Columns, columns: Mapping[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], Sequence[int]]:
    """The columns without rows in which all are blank, and the numbers of the remaining rows.

    Raises `InputError` unless all entries are finite.
    """
    found = dict(columns)
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
                f"{table.path}: variable {name!r} has {wrong.sum()} entries that are blank, NaN or "
                f"infinite, the first at {place}: fill the gaps, cut the record there, or take "
                "read_variables, which keeps them, and fits that take missing outputs"
            )
    return found, rows


def column(table: Columns, name: str) -> np.ndarray:
    """A variable of a table as numbers, or one of its columns, such as ``y[0]``."""
    own, part = table.own_name(name), COLUMN.fullmatch(name)
    if own not in table.variables and part and part[1] in table.variables:
        matrix = np.atleast_2d(table.variables[part[1]])
        columns = matrix if len(matrix) < matrix.shape[1] else matrix.T
        if int(part[2]) >= len(columns):
            raise InputError(f"{table.path}: {part[1]!r} has {len(columns)} columns, no {name!r}")
        return np.asarray(columns[int(part[2])])
    return table.numbers(own)


def _channels(
    file: File, variables: Mapping[str, np.ndarray], names: Sequence[str], kind: str
) -> tuple[list[str], np.ndarray]:
    """Labels and samples (channels, N) of all channels of the named variables."""
    labels: list[str] = []
    rows: list[np.ndarray] = []
    for name in names:
        values = variables[name]
        if values.ndim > 2 or values.ndim == 0 or np.iscomplexobj(values):
            raise InputError(f"{file}: variable {name!r} is no {kind}: it has shape {values.shape}")
        # The longer side holds the samples, whether the file has rows or columns.
        table = np.atleast_2d(
            values.T if values.ndim == 2 and len(values) > values.shape[1] else values
        )
        labels += [name] if len(table) == 1 else [f"{name}[{i}]" for i in range(len(table))]
        rows += list(table.astype(float))
    lengths = {label: len(row) for label, row in zip(labels, rows, strict=True)}
    if len(set(lengths.values())) > 1:
        raise InputError(f"{file}: {kind}s differ in length: {lengths}")
    return labels, np.array(rows)
