"""Inputs and outputs of one experiment, extracted from arrays, tables and datasets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.experiments.instants import (
    ROWS,
    UNEVEN,
    Instants,
    need_same_start,
    of_index,
    of_labels,
    step_of,
)


@dataclass(frozen=True, eq=False)
class Signals:
    """Inputs (N, nu) and outputs (N, ny) of an experiment, with names, units and sampling time.

    ``sample_time`` [s] and ``times`` (N,) [s] are None if they are not given.
    """

    u: RealArray
    y: RealArray
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    sample_time: float | None
    times: RealArray | None


@dataclass(frozen=True, eq=False)
class _Table:
    """An array with the names and units of its channels, and its instants, if known.

    ``oriented`` says whether the samples are known to be the rows.
    """

    values: Any
    names: tuple[str, ...] | None = None
    units: tuple[str, ...] | None = None
    instants: Instants | None = None
    oriented: bool = False


def as_signals(u: Any, y: Any, samples: str | None, experiment: int) -> Signals:
    """The signals of one experiment; `as_experiments` lists the accepted forms.

    Raises
    ------
    InputError
        The data are not a record; the message names the channel and the sample.
    """
    if y is None:
        u, y = _of_dataset(u)
    tables = {"u": _table(u, "u"), "y": _table(y, "y")}
    arrays = {name: _numbers(table, name) for name, table in tables.items()}
    turned = _with_samples_in_rows(arrays, tables, samples)
    if len(turned["u"]) != len(turned["y"]):
        raise InputError(
            f"u has {len(turned['u'])} samples and y {len(turned['y'])}; they must be equal"
        )
    for name, values in turned.items():
        _refuse_infinite(values, name)
    labels = {
        name: table.names or tuple(f"{name}{i + 1}" for i in range(turned[name].shape[1]))
        for name, table in tables.items()
    }
    units = {name: table.units or ("1",) * turned[name].shape[1] for name, table in tables.items()}
    for name, found in labels.items():
        if len(set(found)) < len(found):
            raise InputError(f"two channels of {name} have one name: {', '.join(found)}")
    labels_of = {name: t.instants for name, t in tables.items() if t.instants is not None}
    steps = [step_of(each, name) for name, each in labels_of.items() if each.kind != ROWS]
    if len(steps) == 2 and abs(steps[0] - steps[1]) > UNEVEN * steps[0]:
        raise InputError(
            f"u is sampled every {steps[0]:.6g} s and y every {steps[1]:.6g} s; resample one of "
            "them to the instants of the other"
        )
    if len(labels_of) == 2:
        need_same_start(labels_of["u"], labels_of["y"], steps[0] if steps else 1.0)
    stamped = [each.seconds for each in labels_of.values() if each.kind != ROWS]
    return Signals(
        turned["u"], turned["y"], labels["u"], labels["y"], units["u"], units["y"],
        steps[0] if steps else None, stamped[0] if stamped else None,
    )  # fmt: skip


def _of_dataset(given: Any) -> tuple[Any, Any]:
    """The variables u and y of an xarray dataset."""
    names = getattr(given, "data_vars", None)
    if names is None:
        raise InputError(
            f"y is missing and u is a {type(given).__name__}; give y, or a Dataset with u and y"
        )
    if "u" not in names or "y" not in names:
        raise InputError(
            f"the dataset has the variables {', '.join(map(str, names)) or 'none'}; "
            "u and y are needed: rename its inputs and outputs"
        )
    return given["u"], given["y"]


def _table(given: Any, name: str) -> _Table:
    """An array with the information in its labels."""
    if hasattr(given, "dims") and hasattr(given, "coords"):
        return _labelled(given, name)
    if hasattr(given, "columns") and hasattr(given, "to_numpy"):
        return _of_pandas(given, tuple(map(str, given.columns)), name)
    if hasattr(given, "to_numpy") and hasattr(given, "index"):
        return _of_pandas(given, (str(given.name),) if given.name is not None else None, name)
    return _Table(given)


def _labelled(given: Any, name: str) -> _Table:
    """A DataArray with the dimension "time" and at most one other."""
    if "time" not in given.dims or given.ndim > 2:
        raise InputError(
            f"{name} has the dimensions {', '.join(map(str, given.dims)) or 'none'}; "
            '"time" and at most one of channels are needed'
        )
    others = [dim for dim in given.dims if dim != "time"]
    array = given.transpose("time", *others)
    unit = str(given.attrs.get("units", "1"))
    if others:
        has_names = others[0] in given.coords
        names = tuple(str(v) for v in given[others[0]].values) if has_names else None
        count = given.sizes[others[0]]
    else:
        names, count = ((str(given.name),) if given.name is not None else None), 1
    instants = None
    if "time" in given.coords:
        time = given["time"]
        instants = of_labels(time.values, str(time.attrs.get("units", "s")), name)
    return _Table(array.values, names, (unit,) * count, instants, True)


def _of_pandas(given: Any, names: tuple[str, ...] | None, name: str) -> _Table:
    """A frame or a series; an index of mere row numbers gives no instants."""
    return _Table(given.to_numpy(), names, None, of_index(given.index, name), True)


def _numbers(table: _Table, name: str) -> RealArray:
    """The values as floats, with one or two axes."""
    try:
        values = table.values
        if np.ma.isMaskedArray(values):
            values = np.ma.filled(values.astype(float), np.nan)
        values = np.asarray(values)
        if values.dtype == object:  # tables may hold numbers as objects, with None for missing ones
            values = values.astype(float)
    except (TypeError, ValueError):
        raise InputError(
            f"{name} must hold real numbers in rows of one length, not a "
            f"{type(table.values).__name__} of other things"
        ) from None
    if values.dtype.kind not in "biuf":
        raise InputError(f"{name} must hold real numbers, not {values.dtype}")
    if values.ndim not in (1, 2) or values.size == 0:
        raise InputError(
            f"{name} has shape {values.shape}; samples (N,) or (N, channels) are needed"
        )
    return values.astype(float)


def _with_samples_in_rows(
    arrays: dict[str, RealArray], tables: dict[str, _Table], samples: str | None
) -> dict[str, RealArray]:
    """Arrays with samples along the rows."""
    two = {name: values[:, None] if values.ndim == 1 else values for name, values in arrays.items()}
    known = {name: arrays[name].ndim == 1 or tables[name].oriented for name in arrays}
    if samples is not None:
        turn = samples == "columns"
        return {name: v.T if turn and not known[name] else v for name, v in two.items()}
    u, y = two["u"], two["y"]
    ways = [
        (a, b)
        for a in ((u,) if known["u"] else (u, u.T))
        for b in ((y,) if known["y"] else (y, y.T))
        if len(a) == len(b) and len(a) >= max(a.shape[1], b.shape[1])
    ]
    if not ways:
        return two if len(u) >= u.shape[1] and len(y) >= y.shape[1] else {"u": u.T, "y": y.T}
    a, b = max(ways, key=lambda pair: len(pair[0]))
    if len(ways) > 1 and len({len(pair[0]) for pair in ways}) == 1:
        raise InputError(
            f"u has shape {u.shape} and y {y.shape}, which fit both ways; say where the samples "
            'are: samples="rows" or samples="columns"'
        )
    return {"u": a, "y": b}


def _refuse_infinite(values: RealArray, name: str) -> None:
    wrong = np.argwhere(np.isinf(values))
    if len(wrong):
        sample, channel = (int(i) for i in wrong[0])
        raise InputError(
            f"{name} has {len(wrong)} samples that are infinite, the first at channel {channel}, "
            f"sample {sample}: mark missing samples by NaN, or cut the record there"
        )
