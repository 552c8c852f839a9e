"""The cells of a comparison as labelled arrays."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.heavy_types import Dataset
from workbench.bench.cells.machine import this_machine
from workbench.bench.cells.record import Record
from workbench.bench.comparison import DIMS
from workbench.executor import WALL_TIME
from workbench.solvers import ACCURACY


@dataclass(frozen=True)
class Filled:
    """A cell of the table: how it ended, its key, its code, the tolerance that the method used.

    ``optimal``: the method claims to find the optimum.
    """

    record: Record
    key: str = ""
    code: str = ""
    served: float = np.nan
    optimal: bool = False


Labels = tuple[str, str, str, int]
"""Problem, method, accuracy level, repetition."""


def cell_table(
    entries: Mapping[Labels, Filled],
    programs: Mapping[str, str],
    sizes: Mapping[str, float],
    settings: Mapping[str, Any],
) -> Dataset:
    """The dataset of a comparison, over (problem, by_method, accuracy, repetition).

    A pair of problem and method that was not asked for has an empty outcome, and NaN for numbers.
    """
    import xarray as xr

    axes = [_ordered(labels[axis] for labels in entries) for axis in range(4)]
    axes[2].sort(key=list(ACCURACY).index)
    axes[3].sort()
    shape = tuple(map(len, axes))
    places = [{label: i for i, label in enumerate(axis)} for axis in axes]

    def filled(value: Any, dtype: Any, read: Any, **attrs: Any) -> tuple[Any, ...]:
        values = np.full(shape, value, dtype=dtype)
        for labels, entry in entries.items():
            place = tuple(where[label] for where, label in zip(places, labels, strict=True))
            values[place] = read(entry)
        return DIMS, values, attrs

    def number(name: str, **attrs: Any) -> tuple[Any, ...]:
        return filled(np.nan, float, lambda entry: getattr(entry.record, name), **attrs)

    def text(name: str) -> tuple[Any, ...]:
        return filled("", object, lambda entry: str(getattr(entry.record, name)))

    seconds = {"units": "s"} | WALL_TIME
    return xr.Dataset(
        {
            **{name: text(name) for name in ("outcome", "claim", "message")},
            "certified": filled(0, "int8", lambda entry: int(entry.record.certified)),
            **{name: number(name) for name in ("objective", "scale", "rounding", "gap")},
            **{name: number(name, **seconds) for name in ("statement", "solve", "check", "cpu")},
            "memory": number("memory", units="byte", **WALL_TIME),
            "optimal": filled(0, "int8", lambda entry: int(entry.optimal)),
            "served": filled(np.nan, float, lambda entry: entry.served),
            "key": filled("", object, lambda entry: entry.key),
            "code": filled("", object, lambda entry: entry.code),
        },
        coords={
            **dict(zip(DIMS, axes, strict=True)),
            "tolerance": ("accuracy", [ACCURACY[name] for name in axes[2]]),
            "program": ("problem", [programs.get(name, "") for name in axes[0]]),
            "size": ("problem", [sizes.get(name, np.nan) for name in axes[0]]),
        },
        attrs={**settings, "machine": json.dumps(this_machine(), sort_keys=True)},
    )


def _ordered(labels: Any) -> list[Any]:
    """Labels in the order of their first appearance."""
    return list(dict.fromkeys(labels))
