"""Datasets of comparisons made by hand, to the layout that `workbench.compare` gives."""

import itertools
import json

import numpy as np
import xarray as xr

from workbench.bench.comparison import DIMS
from workbench.bench.comparison.layout import NUMBERS, TEXTS
from workbench.solvers import ACCURACY

LEVELS = ("low", "middle", "high")
SOLVED = {
    "outcome": "solved", "claim": "solved", "message": "", "key": "0123456789abcdef",
    "certified": 1, "optimal": 1, "objective": 1.0, "scale": 1.0, "rounding": 0.0, "gap": 0.0,
    "served": np.nan, "statement": 0.01, "solve": 0.1, "check": 0.02, "cpu": 0.1, "memory": 1e8,
}  # fmt: skip
"""A cell that is solved."""
NOTHING = {name: "" if name in TEXTS else np.nan for name in SOLVED} | {"certified": 0}
"""A cell about which nothing is known."""


def solved(objective=1.0, gap=0.0, **changes):
    """A cell with a certified answer."""
    return SOLVED | {"objective": objective, "scale": abs(objective), "gap": gap} | changes


def inaccurate(objective=1.0, gap=0.5, **changes):
    """A cell that claims the optimum, with a valid answer and an open gap."""
    return solved(objective, gap, **{"outcome": "inaccurate", "certified": 0} | changes)


def heuristic(objective=1.0, gap=np.nan, **changes):
    """A cell with a valid answer that claims no optimum."""
    return solved(objective, gap, **{"optimal": 0} | changes)


def nothing(outcome, claim="", **changes):
    """A cell without an answer."""
    return NOTHING | {"outcome": outcome, "claim": claim, "optimal": 1, "solve": 0.1} | changes


def invalid(claim="solved"):
    """A cell whose answer was checked and is not valid."""
    return nothing("failed", claim, check=0.01, message="containment: 0.5 exceeds 1e-09")


def proven(claim):
    """A cell with a proof that there is no answer, or no least value."""
    return nothing(claim, claim, certified=1, check=0.01)


def made(cells, levels=("middle",), repetitions=1, programs=None, sizes=None, **attrs):
    """A dataset of cells by labels: problem, method, level and repetition, the last two optional.

    A cell given without a level, or without a repetition, holds for all of them.
    """
    problems, methods = (list(dict.fromkeys(label[k] for label in cells)) for k in (0, 1))
    shape = (len(problems), len(methods), len(levels), repetitions)
    arrays = {
        name: np.full(shape, NOTHING[name], dtype=object if name in TEXTS else float)
        for name in (*TEXTS, *NUMBERS)
    }
    for label, cell in cells.items():
        over = [levels, range(repetitions)]
        given = [[one] for one in label[2:]] + over[len(label) - 2 :]
        for level, repetition in itertools.product(*given):
            place = (
                problems.index(label[0]), methods.index(label[1]),
                list(levels).index(level), repetition,
            )  # fmt: skip
            for name, array in arrays.items():
                array[place] = cell[name]
    units = dict.fromkeys(("statement", "solve", "check", "cpu"), "s") | {"memory": "byte"}
    return xr.Dataset(
        {
            name: (DIMS, array.astype(str) if name in TEXTS else array, {"units": units[name]})
            if name in units
            else (DIMS, array.astype(str) if name in TEXTS else array)
            for name, array in arrays.items()
        },
        coords={
            "problem": problems,
            "by_method": methods,
            "accuracy": list(levels),
            "repetition": list(range(repetitions)),
            "tolerance": ("accuracy", [ACCURACY[level] for level in levels]),
            "program": ("problem", [(programs or {}).get(name, "Circle") for name in problems]),
            "size": ("problem", [(sizes or {}).get(name, np.nan) for name in problems]),
        },
        attrs={"seed": 0, "parameters": json.dumps({})} | attrs,
    )


def synthetic(problems=12, methods=10, repetitions=3, seed=0):
    """A comparison of many problems: methods that get slower, some that fail, one that boasts."""
    rng = np.random.default_rng(seed)
    cells, sizes = {}, {}
    for i in range(problems):
        name, size = f"textbook/problem-{i}", 10.0 * 2 ** (i % 6)
        sizes[name], best = size, 1.0 + i
        for j in range(methods):
            for k, level in enumerate(LEVELS):
                for n in range(repetitions):
                    time = 1e-4 * size * (1 + j) ** 1.5 * (k + 1) * rng.lognormal(0, 0.05)
                    gap = ACCURACY[level] * rng.uniform(0, 1) * (1 if j else 0)
                    cell = solved(best * (1 + gap), gap, solve=time, statement=0.3 * time)
                    if j == 3 and level == "high":
                        cell = inaccurate(best * (1 + 1e-7), 1e-7, solve=time)
                    if j == 4 and i % 5 == 0:
                        cell = inaccurate(0.02 * best, -0.98, solve=time, scale=best)
                    if j == 5 and level != "low" and i % 2:
                        cell = nothing("time limit", message="stopped after 10 s", solve=10.0)
                    cells[name, f"method-{j}", level, n] = cell
    return made(cells, LEVELS, repetitions, sizes=sizes, time_limit=10.0)
