"""Arrays, systems, programs and stored answers with the last bits of their numbers changed."""

from dataclasses import fields, is_dataclass, replace

import control
import numpy as np
import xarray as xr


def shaken(value, seed):
    """A value with each double in it times 1 - eps, 1 or 1 + eps.

    Arrays, systems, datasets, and dataclasses and containers of them. Equal numbers stay equal, so
    that a symmetric matrix stays symmetric, and a pair conjugate. Numbers of half the bits stay:
    zeros by structure, counts, coefficients of a processor. So do numbers beside arrays, which are
    settings.
    """
    if isinstance(value, np.ndarray):
        return _array(value, seed)
    if isinstance(value, control.StateSpace):
        parts = (_array(np.asarray(getattr(value, part)), seed) for part in "ABCD")
        return control.ss(*parts, value.dt, inputs=value.input_labels, outputs=value.output_labels)
    if isinstance(value, control.TransferFunction):
        num, den = (
            [[_array(one, seed) for one in row] for row in part] for part in (value.num, value.den)
        )
        names = {"inputs": value.input_labels, "outputs": value.output_labels}
        return control.tf(num, den, value.dt, **names)
    if isinstance(value, xr.Dataset):
        return value.assign({name: shaken(one, seed) for name, one in value.data_vars.items()})
    if isinstance(value, xr.DataArray):
        return value.copy(data=_array(value.values, seed))
    if isinstance(value, tuple | list):
        found = [shaken(one, seed) for one in value]
        return type(value)(*found) if hasattr(value, "_fields") else type(value)(found)
    if isinstance(value, dict):
        return {key: shaken(one, seed) for key, one in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        given = {one.name: getattr(value, one.name) for one in fields(value) if one.init}
        changed = {name: shaken(one, seed) for name, one in given.items()}
        changed = {name: one for name, one in changed.items() if one is not given[name]}
        return _changed(value, changed) if changed else value
    return value


def _changed(value, changed):
    """A dataclass with other fields, made anew unless it makes its fields of something else."""
    if value.__dataclass_params__.init:
        return replace(value, **changed)
    found = object.__new__(type(value))
    for name, one in (
        {one.name: getattr(value, one.name) for one in fields(value)} | changed
    ).items():
        object.__setattr__(found, name, one)
    return found


def _array(values, seed):
    if values.dtype.kind == "c":
        found = np.empty_like(values)
        found.real, found.imag = _array(values.real, seed), _array(values.imag, seed)
        return found
    if values.dtype.kind != "f" or values.dtype.itemsize > 8:
        return values
    steps = _steps(np.abs(values).astype(float), seed) * np.finfo(values.dtype).eps
    with np.errstate(over="ignore", under="ignore"):
        short = values.astype(np.float32 if values.dtype.itemsize > 4 else np.float16)
    kept = ~np.isfinite(values) | (values == short)
    return np.where(kept, values, values * (1 + steps)).astype(values.dtype)


def _steps(sizes, seed):
    """-1, 0 or 1 for each number, by a hash of its bits and the seed (splitmix64)."""
    with np.errstate(over="ignore"):
        z = np.ascontiguousarray(sizes).view(np.uint64).reshape(sizes.shape)
        z = z + np.uint64(seed + 1) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return ((z ^ (z >> np.uint64(31))) % np.uint64(3)).astype(float) - 1
