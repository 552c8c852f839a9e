"""Changes between two comparisons, for instance before and after a new version of a solver."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import stdtrit

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset
from workbench._core.tables import markdown_table
from workbench.bench.comparison.layout import DIMS, METHOD, cell_labels
from workbench.bench.comparison.numbers import certified_times, combined_verdicts, largest_gap
from workbench.bench.comparison.verdicts import judged_cells
from workbench.errors import InputError

CONFIDENCE = 0.95
"""Confidence of the intervals for ratios of times."""
CHANGED_HEADS = ["problem", "method", "accuracy", "verdict before", "verdict now"]
RATIO_HEADS = ["method", "cells", "time now / before", "interval"]
GAP_HEADS = ["method", "cells", "largest gap before", "largest gap now"]


def changes(old: Dataset, new: Dataset) -> Dataset:
    """Changes between two comparisons of the same problems, by cell and by method.

    Parameters
    ----------
    old, new
        Datasets of comparisons. Problems, methods and levels that only one of them has are left
        out; they are listed in the attributes ``only_old`` and ``only_new``.

    Returns
    -------
    Dataset
        It has dims (problem, by_method, accuracy): ``verdict``, median ``time`` [s] of certified
        cells and largest ``gap``, each with the dim ``version`` ("before", "now"); ``changed``, 1
        if the verdict differs. With the dim by_method: ``ratio``, the geometric mean of the ratio
        of times, ``ratio_low`` and ``ratio_high``, its 95 % confidence interval, and ``pairs``, the
        number of cells that both comparisons certify. The interval is Student's, for the
        logarithms; NaN with fewer than two pairs.

    Raises
    ------
    InputError
        The comparisons have no problem, method or level in common, or differ in their parameters.
    ResultError
        One of them is not a comparison.
    """
    import xarray as xr

    old, new = judged_cells(old), judged_cells(new)
    _need_same_parameters(old, new)
    common: dict[str, list[str]] = {}
    only: dict[str, list[str]] = {"only_old": [], "only_new": []}
    for dim in DIMS[:3]:
        before, now = ([str(value) for value in data[dim].values] for data in (old, new))
        common[dim] = [label for label in before if label in now]
        only["only_old"] += [label for label in before if label not in now]
        only["only_new"] += [label for label in now if label not in before]
        if not common[dim]:
            raise InputError(
                f"the comparisons have no {dim.removeprefix('by_')} in common: "
                f"{', '.join(before)} before, {', '.join(now)} now"
            )
    found = [_numbers(data.sel(common)) for data in (old, new)]
    verdict, time, gap = (np.stack(each) for each in zip(*found, strict=True))
    both = (verdict != "").all(axis=0)
    cells = DIMS[:3]
    ratios = _ratios(time[0], time[1])
    names = ("ratio", "ratio_low", "ratio_high", "pairs")
    return xr.Dataset(
        {
            "verdict": (("version", *cells), verdict.astype(str)),
            "time": (("version", *cells), time, {"units": "s", "long_name": "median time"}),
            "gap": (("version", *cells), gap, {"units": "1", "long_name": "largest gap"}),
            "changed": (cells, ((verdict[0] != verdict[1]) & both).astype("int8")),
            **{name: (METHOD, ratios[:, k], {"units": "1"}) for k, name in enumerate(names)},
        },
        coords=common | {"version": ["before", "now"]},
        attrs={name: ", ".join(labels) for name, labels in only.items()},
    )


def changes_table(found: Dataset) -> str:
    """Markdown tables of the result of `changes`: verdicts, times and gaps."""
    rows = _changed_rows(found)
    both = (found["verdict"].values != "").all(axis=0)
    count = int(both.sum())
    text = [f"{len(rows)} of {count} cells have another verdict.\n"]
    if rows:
        text.append(markdown_table(CHANGED_HEADS, rows))
    for name, words in (("only_old", "before"), ("only_new", "now")):
        if found.attrs[name]:
            text.append(f"Only {words}: {found.attrs[name]}\n")
    text += [
        f"Times: geometric mean of the ratio over cells that both certify, with its interval of "
        f"{CONFIDENCE:.0%}. Below 1 is faster now.\n",
        markdown_table(RATIO_HEADS, [_ratio_row(found, j) for j in range(found.sizes[METHOD])]),
    ]
    gaps = [row for j in range(found.sizes[METHOD]) if (row := _gap_row(found, j))]
    if gaps:
        text += ["Gaps of the cells that have one in both:\n", markdown_table(GAP_HEADS, gaps)]
    return "\n".join(text)


def changed_cells(found: Dataset) -> list[dict[str, str]]:
    """The cells whose verdict has changed, as data for a script."""
    return [dict(zip(CHANGED_HEADS, row, strict=True)) for row in _changed_rows(found)]


def _changed_rows(found: Dataset) -> list[list[str]]:
    """Labels, earlier verdict and present verdict of the cells whose verdict has changed."""
    return [
        [*cell_labels(found, place), *found["verdict"].values[(slice(None), *place)].tolist()]
        for place in zip(*np.nonzero(found["changed"].values), strict=True)
    ]


def _need_same_parameters(old: Dataset, new: Dataset) -> None:
    """Raise `InputError` if the comparisons do not have the same problems."""
    before, now = (str(data.attrs.get("parameters") or "{}") for data in (old, new))
    if before != now:
        raise InputError(
            f"the comparisons have parameters {before} and {now}; only those of the same problems "
            "can be compared"
        )


def _numbers(data: Dataset) -> tuple[np.ndarray, RealArray, RealArray]:
    """Verdict, median time of certified cells and largest gap (problem, method, accuracy)."""
    gaps = np.asarray(data["gap"].values, dtype=float)
    gap = np.full(gaps.shape[:3], np.nan)
    for place in np.ndindex(*gap.shape):
        gap[place] = largest_gap(gaps[place])
    return combined_verdicts(data), certified_times(data)[1], gap


def _ratios(before: RealArray, now: RealArray) -> RealArray:
    """Geometric mean of the ratio of times, its interval and the number of pairs (method, 4)."""
    found = np.full((before.shape[1], 4), np.nan)
    for j in range(before.shape[1]):
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.log(now[:, j] / before[:, j]).ravel()
        logs = logs[np.isfinite(logs)]
        found[j, 3] = logs.size
        if not logs.size:
            continue
        found[j, 0] = np.exp(logs.mean())
        if logs.size > 1:
            deviation = logs.std(ddof=1) / np.sqrt(logs.size)
            error = deviation * stdtrit(logs.size - 1, (1 + CONFIDENCE) / 2)
            found[j, 1:3] = np.exp(logs.mean() + error * np.array([-1.0, 1.0]))
    return found


def _ratio_row(found: Dataset, j: int) -> list[Any]:
    ratio, low, high, pairs = (
        float(found[name].values[j]) for name in ("ratio", "ratio_low", "ratio_high", "pairs")
    )
    interval = "-" if np.isnan(low) else f"{low:.3g} to {high:.3g}"
    name = str(found[METHOD].values[j])
    return [name, str(int(pairs)), "-" if np.isnan(ratio) else f"{ratio:.3g}", interval]


def _gap_row(found: Dataset, j: int) -> list[Any]:
    """Largest gaps of a method before and now; empty if no cell has a gap in both."""
    before, now = (each.ravel() for each in found["gap"].values[:, :, j])
    both = ~(np.isnan(before) | np.isnan(now))
    if not both.any():
        return []
    gaps = [f"{largest_gap(each[both]):.1e}" for each in (before, now)]
    return [str(found[METHOD].values[j]), str(int(both.sum())), *gaps]
