"""Statistics of a comparison: counts of verdicts, times over repetitions, means over problems."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset
from workbench.bench.comparison.layout import METHOD, UNFIT, seconds, time_limit, tried
from workbench.bench.comparison.verdicts import CERTIFIED, CONTRADICTION, WRONG

SHIFTS = (0.01, 10.0)
"""Shifts [s] of geometric means. The first exceeds the overhead of a call and still resolves
programs that take milliseconds; the second is that of H. Mittelmann's tables and of qpbenchmark,
for large programs.
"""
QUARTILES = (0.25, 0.5, 0.75)


def certified(data: Dataset) -> np.ndarray:
    """Mask of the cells with a certified verdict: an answer, or the proof that there is none."""
    return np.isin(data["verdict"].values, CERTIFIED)


def counts(data: Dataset) -> dict[str, int]:
    """Numbers of cells with verdicts: tried, certified, wrong, contradicting, unfit."""
    verdict, here = data["verdict"].values, tried(data)
    return {
        "cells": int(here.sum()),
        "certified": int(certified(data).sum()),
        "false_claims": int((verdict == WRONG).sum()),
        "contradictions": int((verdict == CONTRADICTION).sum()),
        "unfit": int((data["outcome"].values == UNFIT).sum()),
    }


def badge(data: Dataset) -> str:
    """The two main numbers of a comparison: "certified 44 of 45, 1 false claim"."""
    found = counts(data)
    words = f"certified {found['certified']} of {found['cells']}"
    for name, number in (("false claim", "false_claims"), ("contradiction", "contradictions")):
        if found[number] or name == "false claim":
            words += f", {found[number]} {name}{'' if found[number] == 1 else 's'}"
    return words


def combined_verdicts(data: Dataset) -> np.ndarray:
    """One verdict (problem, method, accuracy) for all repetitions; several joined by " / "."""
    verdict = data["verdict"].values
    found = np.empty(verdict.shape[:3], dtype=object)
    for place in np.ndindex(*found.shape):
        found[place] = " / ".join(dict.fromkeys(verdict[place].tolist()))
    return found


def quartiles(values: RealArray) -> RealArray:
    """Quartiles and median (3, ...) over the last axis, ignoring NaN; NaN if nothing is left."""
    count = np.isfinite(values).sum(axis=-1)
    found = np.full((3, *values.shape[:-1]), np.nan)
    for place in map(tuple, np.argwhere(count)):
        kept = values[place][np.isfinite(values[place])]
        found[(slice(None), *place)] = np.quantile(kept, QUARTILES)
    return found


def largest_gap(gaps: RealArray) -> float:
    """The largest gap by absolute value among repetitions (R,), with its sign; NaN if unknown."""
    known = gaps[~np.isnan(gaps)]
    return float(known[np.argmax(np.abs(known))]) if known.size else float("nan")


def certified_times(data: Dataset) -> RealArray:
    """Quartiles of statement and solve time [s], (3, problem, method, accuracy), if certified.

    NaN if a repetition has no certificate: then the method did not answer the problem each time.
    """
    times = quartiles(np.asarray(seconds(data).values, dtype=float))
    every = (certified(data) | (data["outcome"].values == "")).all(axis=-1)
    some = certified(data).any(axis=-1)
    return np.where(every & some, times, np.nan)


def penalty(data: Dataset) -> float:
    """Time [s] that a problem without a certificate counts as.

    It is the time limit or, without one, the longest time of any cell.
    """
    limit = time_limit(data)
    if limit is not None:
        return limit
    times = np.asarray(seconds(data).values, dtype=float)
    known = times[np.isfinite(times)]
    return float(known.max()) if known.size else float("nan")


def shifted_mean(times: Iterable[float], shift: float) -> float:
    """The shifted geometric mean of times [s], exp(mean log(t + shift)) - shift; NaN of none.

    Source: T. Achterberg, Constraint Integer Programming (2007), appendix A.3.
    """
    given = np.asarray(list(times), dtype=float)
    if not given.size:
        return float("nan")
    return float(np.exp(np.mean(np.log(given + shift))) - shift)


def disagreements(data: Dataset) -> RealArray:
    """Largest relative difference (method, method) of the objectives of valid answers.

    Cells of the same problem, accuracy and repetition are compared, relative to the larger of their
    scales. NaN if two methods share no problem with an objective.
    """
    objective = np.asarray(data["objective"].values, dtype=float).swapaxes(0, 1)
    scale = np.asarray(data["scale"].values, dtype=float).swapaxes(0, 1)
    count = data.sizes[METHOD]
    found = np.full((count, count), np.nan)
    for i in range(count):
        with np.errstate(invalid="ignore", divide="ignore"):
            apart = np.abs(objective[i] - objective) / np.fmax(scale[i], scale)
        apart = np.where(apart == 0, 0.0, apart)
        equal = np.isfinite(objective) & (objective == objective[i])
        apart = np.where(equal, 0.0, apart).reshape(count, -1)
        some = np.isfinite(apart).any(axis=1)
        found[i, some] = np.nanmax(np.where(np.isfinite(apart), apart, np.nan)[some], axis=1)
    return found


def groups(data: Dataset) -> Iterator[tuple[str, Dataset]]:
    """The comparison split by the Program of its problems, each with that Program's methods.

    Methods of different Programs cannot be compared, so tables of means and figures show each
    Program separately. Problems that no method can take are left out.
    """
    here = tried(data)
    programs = np.asarray(data["program"].values, dtype=object)
    for program in dict.fromkeys(programs[here.any(axis=(1, 2, 3))].tolist()):
        problems = (programs == program) & here.any(axis=(1, 2, 3))
        methods = here[problems].any(axis=(0, 2, 3))
        yield str(program), data.isel({"problem": problems, METHOD: methods})
