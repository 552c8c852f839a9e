"""Reading of records and responses from CSV, MAT and NetCDF files into labelled datasets.

Every error names the file and the line or the variable.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from workbench.errors import InputError
from workbench.heavy_types import Dataset
from workbench.identification.experiments.variables import File, read_variables


def read_record(
    file: File,
    inputs: Sequence[str],
    outputs: Sequence[str],
    sample_rate: float | None = None,
    time: str | None = None,
) -> Dataset:
    """Read a record of inputs and outputs from a file.

    Parameters
    ----------
    file
        A file that `read_variables` reads.
    inputs, outputs
        Names of variables; a variable with several columns gives several channels.
    sample_rate
        Sampling frequency [Hz].
    time
        Name of a variable with equidistant instants [s], instead of ``sample_rate``.

    Returns
    -------
    Dataset
        ``u`` (input, time) and ``y`` (output, time).

    Raises
    ------
    InputError
        The file cannot be read; a variable is missing, contains NaN or differs in length; or the
        instants are not equidistant.
    """
    import xarray as xr

    if (sample_rate is None) == (time is None):
        raise InputError(f"{file}: give either the sample rate or the name of the time variable")
    variables = read_variables(file)
    signals = {
        channel: _channels(file, variables, names, channel)
        for channel, names in (("input", inputs), ("output", outputs))
    }
    lengths = {values.shape[1] for _, values in signals.values()}
    if len(lengths) > 1:
        raise InputError(f"{file}: inputs and outputs differ in length: {sorted(lengths)} samples")
    count = lengths.pop()
    if time is None:
        instants = np.arange(count) / sample_rate
    else:
        instants = _pick(file, variables, time).ravel()
        steps = np.diff(instants)
        if len(instants) != count or count < 2 or not steps[0] > 0:
            raise InputError(f"{file}: variable {time!r} needs {count} rising instants")
        # Instants in text files are rounded, so deviations up to a tenth of a step are accepted.
        apart = np.abs(steps - steps.mean()) > 0.1 * steps.mean()
        if apart.any():
            raise InputError(
                f"{file}: variable {time!r} is not equidistant at sample {np.argmax(apart) + 1}: "
                "resample the record or cut it there"
            )
    arrays = {
        name: ((channel, "time"), signals[channel][1], {"units": "1", "long_name": f"{channel}s"})
        for name, channel in (("u", "input"), ("y", "output"))
    }
    coords = {channel: labels for channel, (labels, _) in signals.items()}
    unit = {"units": "s", "long_name": "time"}
    return xr.Dataset(arrays, coords={"time": ("time", instants, unit), **coords})


def read_response(file: File, frequency: str, response: str | tuple[str, str]) -> Dataset:
    """Read a measured frequency response from a file.

    Parameters
    ----------
    file
        A file that `read_variables` reads.
    frequency
        Name of the variable with the frequencies [Hz].
    response
        Name of a complex variable, (F,) or (F, outputs, inputs), or names of its real and its
        imaginary part.

    Returns
    -------
    Dataset
        ``response`` (frequency, output, input).
    """
    import xarray as xr

    variables = read_variables(file)
    frequencies = _pick(file, variables, frequency).ravel()
    if isinstance(response, str):
        values = np.asarray(_pick(file, variables, response), dtype=complex)
    else:
        real, imaginary = (_pick(file, variables, name) for name in response)
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
    )


def _pick(file: File, variables: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    """A variable by name; an `InputError` if it is missing or not finite."""
    if name not in variables:
        raise InputError(
            f"{file} has no variable {name!r}; it has {', '.join(variables) or 'none'}"
        )
    values = variables[name]
    wrong = ~np.isfinite(values)
    if wrong.any():
        place = ", ".join(str(i) for i in np.argwhere(wrong)[0])
        raise InputError(
            f"{file}: variable {name!r} has {wrong.sum()} entries that are NaN or infinite, the "
            f"first at index {place}"
        )
    return values


def _channels(
    file: File, variables: Mapping[str, np.ndarray], names: Sequence[str], kind: str
) -> tuple[list[str], np.ndarray]:
    """Labels and samples (channels, N) of the channels in the variables of given names."""
    labels: list[str] = []
    rows: list[np.ndarray] = []
    for name in [names] if isinstance(names, str) else names:
        values = _pick(file, variables, name)
        if values.ndim > 2 or values.ndim == 0 or np.iscomplexobj(values):
            raise InputError(f"{file}: variable {name!r} is no {kind}: it has shape {values.shape}")
        # Take the longer side as the samples, whether the file has rows or columns.
        table = np.atleast_2d(
            values.T if values.ndim == 2 and len(values) > values.shape[1] else values
        )
        labels += [name] if len(table) == 1 else [f"{name}[{i}]" for i in range(len(table))]
        rows += list(table.astype(float))
    if not rows:
        raise InputError(f"{file}: name one {kind} or more")
    lengths = {label: len(row) for label, row in zip(labels, rows, strict=True)}
    if len(set(lengths.values())) > 1:
        raise InputError(f"{file}: {kind}s differ in length: {lengths}")
    return labels, np.array(rows)
