"""The layout of a comparison's dataset: dimensions, variables, and functions that read cells.

A cell is one problem by one method at one accuracy level, in one repetition. A pair of a problem
and a method that was not asked for has the outcome "" everywhere; it is not a cell.
"""

from __future__ import annotations

import json
import math
import shlex
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import DataArray, Dataset
from workbench.errors import ResultError
from workbench.solvers import Outcome

METHOD = "by_method"
"""Name of the dimension of methods; xarray's ``sel`` reserves the word method."""
DIMS = ("problem", METHOD, "accuracy", "repetition")
"""Dimensions of every variable."""
UNFIT = "unfit"
"""Outcome of a cell whose method cannot take its problem."""
NOT_COMPARED = "not compared"
"""Outcome of a cell whose method is compared only if it is named."""
KNOWN = {*map(str, Outcome), UNFIT, NOT_COMPARED, ""}
"""Every outcome of a cell."""
TEXTS = ("outcome", "claim", "message", "key")
NUMBERS = (
    "certified", "optimal", "objective", "scale", "rounding", "gap", "served",
    "statement", "solve", "check", "cpu", "memory",
)  # fmt: skip
LATER = ("code",)
"""Variables that are missing in comparisons of older versions."""
COORDINATES = (*DIMS, "tolerance", "program", "size")


def need_comparison(data: Dataset) -> Dataset:
    """The dataset, once it is checked to have everything that a comparison has.

    Raises
    ------
    ResultError
        It has other dimensions, or lacks variables or coordinates; the message names them.
    """
    again = "run `workbench compare` again to make it anew"
    outcome = data.get("outcome")
    if outcome is None:
        raise ResultError(f"this is no comparison: it has no variable outcome; {again}")
    if outcome.dims != DIMS:
        raise ResultError(
            f"this comparison has dimensions {', '.join(map(str, outcome.dims))}; "
            f"{', '.join(DIMS)} are needed: it was made by an older version; {again}"
        )
    missing = [name for name in (*TEXTS, *NUMBERS) if name not in data.data_vars]
    missing += [name for name in COORDINATES if name not in data.coords]
    if missing:
        raise ResultError(f"this comparison lacks {', '.join(missing)}; {again}")
    given = [name for name in (*TEXTS, *NUMBERS, *LATER) if name in data]
    other = [name for name in given if data[name].dims != DIMS]
    if other:
        raise ResultError(f"{', '.join(other)} must have dimensions {', '.join(DIMS)}; {again}")
    unknown = set(outcome.values.ravel().tolist()) - KNOWN
    if unknown:
        raise ResultError(f"this comparison has unknown outcomes: {', '.join(sorted(unknown))}")
    return data


def asked_cells(data: Dataset) -> np.ndarray:
    """Mask of the cells of a problem and one of its methods, be that fit and compared or not."""
    return np.asarray(data["outcome"].values != "")


def tried(data: Dataset) -> np.ndarray:
    """Mask of the cells whose method was given the problem, and can take it."""
    return ~np.isin(data["outcome"].values, ("", UNFIT, NOT_COMPARED))


def seconds(data: Dataset) -> DataArray:
    """Wall time [s] of statement and solve for every cell."""
    return data["statement"] + data["solve"]


def tolerances(data: Dataset) -> RealArray:
    """Tolerance by which a method's claim of the optimum is judged, for every cell."""
    return np.asarray(data["tolerance"].broadcast_like(data["outcome"]).transpose(*DIMS).values)


def per_problem(data: Dataset, name: str) -> list[Any]:
    """Values of a coordinate of the problems, one for each problem."""
    values: list[Any] = data[name].values.tolist()
    return values


def time_limit(data: Dataset) -> float | None:
    """Time limit [s] of the cells; None without one."""
    return _positive(data.attrs.get("time_limit"))


def cell_labels(data: Dataset, place: tuple[int, ...]) -> list[str]:
    """Problem, method and accuracy level of a cell, by its index in the arrays."""
    return [str(data[dim].values[i]) for dim, i in zip(DIMS[:3], place[:3], strict=True)]


def command(data: Dataset, place: tuple[int, ...]) -> str:
    """The command that computes a cell anew, by its index in the arrays."""
    problem, method, level = cell_labels(data, place)
    words = ["workbench", "run", problem, "--method", method, "--tolerance", level]
    limit = time_limit(data)
    if limit is not None:
        words += ["--time-limit", f"{limit:g}"]
    words += ["--seed", str(int(data.attrs.get("seed", 0)))]
    for name, value in json.loads(data.attrs.get("parameters") or "{}").items():
        words += ["--set", f"{name}={value if isinstance(value, str) else json.dumps(value)}"]
    return shlex.join([*words, "--fresh"])


def _positive(given: Any) -> float | None:
    """A positive finite number; None for anything else that an attribute may hold."""
    try:
        value = float(given)
    except (TypeError, ValueError):
        return None
    return value if 0.0 < value < math.inf else None
