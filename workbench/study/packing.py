"""Datasets of one kind packed into a few variables of one dataset, entries one after another.

A hundred answers of eight arrays each would be eight hundred variables, and opening the file would
take longer than reading it.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import prod
from typing import Any

import numpy as np

from workbench._core.heavy_types import Dataset
from workbench.errors import InputError

ABSENT = -1
"""Marks a variable that the dataset of a label does not have, in place of its number of entries."""


def packed_datasets(name: str, datasets: Mapping[str, Dataset]) -> dict[str, Any]:
    """Variables that hold one dataset for each label; all their names begin with ``name``.

    Raises
    ------
    InputError
        Variables of the same name have different dimensions.
    """
    kinds = dict.fromkeys(str(one) for data in datasets.values() for one in data.variables)
    found: dict[str, Any] = {f"{name}_label": (f"{name}_label", list(datasets), {})}
    for kind in kinds:
        held = {label: data.variables.get(kind) for label, data in datasets.items()}
        present = {label: one for label, one in held.items() if one is not None}
        first = next(iter(present.values()))
        dims = tuple(map(str, first.dims))
        for label, one in present.items():
            if one.dims != first.dims:
                raise InputError(
                    f"{kind!r} of {label!r} has the dimensions {one.dims}; of others {first.dims}"
                )
        entries = np.concatenate([np.ravel(one.values) for one in present.values()])
        sizes = [
            [ABSENT] * (len(dims) + 1) if one is None else [one.size, *one.shape]
            for one in held.values()
        ]
        about = {**first.attrs, "dimensions": " ".join(dims)}
        found[kind] = (f"{kind}_entry", entries, about)
        found[f"{kind}_shape"] = ((f"{name}_label", f"{kind}_axis"), sizes, {})
    return found


def unpacked_datasets(name: str, data: Dataset) -> dict[str, Dataset]:
    """The datasets by label that `packed_datasets` packed; empty if there are none under this name.

    Raises
    ------
    InputError
        The sizes do not agree with the number of entries.
    """
    import xarray as xr

    start, end = f"{name}_", "_shape"
    if f"{start}label" not in data.variables:
        return {}
    labels = list(map(str, data[f"{start}label"].values))
    found: dict[str, dict[str, Any]] = {label: {} for label in labels}
    names = [str(one) for one in data.variables]
    for table in (one for one in names if one.startswith(start) and one.endswith(end)):
        place = table.removesuffix(end)
        entries, sizes = data[place].values, data[table].values
        dims = tuple(data[place].attrs["dimensions"].split())
        counts = [int(row[0]) for row in sizes]
        shapes = [tuple(map(int, row[1:])) for row in sizes]
        held = [(count, shape) for count, shape in zip(counts, shapes, strict=True) if count >= 0]
        if any(min(s, default=0) < 0 or prod(s) != n for n, s in held) or (
            sum(n for n, _ in held) != len(entries)
        ):
            raise InputError(f"{table!r} does not say how {len(entries)} entries of {place!r} lie")
        at = 0
        for label, count, shape in zip(labels, counts, shapes, strict=True):
            if count >= 0:
                values = entries[at : at + count].reshape(shape)
                found[label][place] = (dims, values, data[place].attrs)
                at += count
    return {label: xr.Dataset(variables) for label, variables in found.items()}
