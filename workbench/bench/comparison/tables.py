"""Tables of a comparison: cells, means of time and shares solved, failures, agreement."""

from __future__ import annotations

import numpy as np

from workbench._core.heavy_types import Dataset
from workbench._core.tables import Rows, markdown_table
from workbench.bench.comparison.layout import (
    METHOD,
    NOT_COMPARED,
    UNFIT,
    asked_cells,
    cell_labels,
    command,
    per_problem,
    time_limit,
    tried,
)
from workbench.bench.comparison.numbers import (
    SHIFTS,
    certified_times,
    combined_verdicts,
    disagreements,
    groups,
    largest_gap,
    penalty,
    quartiles,
    shifted_mean,
)
from workbench.bench.comparison.verdicts import CERTIFIED, CONTRADICTION, WRONG
from workbench.solvers import Outcome

HEADS = [
    "problem", "method", "accuracy", "verdict", "claim", "gap", "objective",
    "statement [s]", "solve [s]", "CPU [s]", "memory [MB]",
]  # fmt: skip
"""Heads of the table of `rows`."""
MEAN_HEADS = ["method", "accuracy", "problems", "certified", "share", "false claims"] + [
    f"mean time, shift {shift:g} s" for shift in SHIFTS
]
FAILURE_HEADS = ["problem", "method", "accuracy", "verdict", "reason", "command"]
ORDER = (CONTRADICTION, WRONG, str(Outcome.INACCURATE))
"""Verdicts that are listed first among the failures."""


def rows(data: Dataset) -> list[list[str]]:
    """The cells of a dataset with verdicts as text; the repetitions of a cell share a row.

    Times are medians, with quartiles if there are repetitions; the gap is the largest.
    """
    verdicts = combined_verdicts(data)
    times = {n: quartiles(data[n].values) for n in ("statement", "solve", "cpu", "memory")}
    median = {n: quartiles(data[n].values)[1] for n in ("gap", "objective")}
    table = []
    for place in zip(*np.nonzero(asked_cells(data).any(axis=-1)), strict=True):
        problem, method, level = cell_labels(data, place)
        spent = [_spread(times[name][(slice(None), *place)]) for name in ("statement", "solve")]
        claims = dict.fromkeys(data["claim"].values[place].tolist())
        table.append(
            [
                *(problem, method, level, str(verdicts[place])),
                " / ".join(claims) or "-",
                _number(largest_gap(data["gap"].values[place]), ".1e"),
                _number(median["objective"][place], ".8g"),
                *spent,
                _number(times["cpu"][(1, *place)], ".4f"),
                _number(times["memory"][(1, *place)] / 1e6, ".0f"),
            ]
        )
    return table


def means(data: Dataset, late: float) -> Rows:
    """Share certified, false claims and mean times by method and accuracy, for one Program.

    Means are over the problems that the method can take. A problem without a certificate counts as
    ``late`` [s].
    """
    times, here = certified_times(data)[1], tried(data)
    verdict, table = data["verdict"].values, []
    for j, method in enumerate(data[METHOD].values):
        for k, level in enumerate(data["accuracy"].values):
            problems = here[:, j, k].any(axis=-1)
            if not problems.any():
                continue
            found = times[problems, j, k]
            solved = int(np.isfinite(found).sum())
            wrong = int((verdict[:, j, k] == WRONG).sum())
            spent = np.where(np.isfinite(found), found, late)
            numbers = [shifted_mean(spent, shift) for shift in SHIFTS]
            table.append(
                [
                    *(str(method), str(level), str(len(found)), str(solved)),
                    f"{solved / len(found):.0%}",
                    str(wrong),
                    *(_number(number, ".4g") for number in numbers),
                ]
            )
    return MEAN_HEADS, table


def failures(data: Dataset) -> Rows:
    """The cells without a certified verdict, with the reason and the command that repeats each.

    Contradictions and wrong claims come first. Repetitions with the same verdict share a row.
    """
    verdict, done = data["verdict"].values, {*CERTIFIED, UNFIT, NOT_COMPARED, ""}
    found = {}
    for place in np.ndindex(*verdict.shape):
        word = str(verdict[place])
        if word in done or (*place[:3], word) in found:
            continue
        said = " ".join(str(data["message"].values[place]).split())
        why = str(data["reason"].values[place])
        reason = f"{why}; {said}" if why and said else why or said or "-"
        row = [
            *cell_labels(data, place),
            word,
            reason.replace("|", "/"),
            f"`{command(data, place)}`",
        ]
        found[*place[:3], word] = row
    rank = {word: place for place, word in enumerate(ORDER)}
    return FAILURE_HEADS, sorted(found.values(), key=lambda row: rank.get(row[3], len(rank)))


def agreement(data: Dataset) -> Rows:
    """Largest relative difference of objectives between methods, for one Program."""
    names = [str(name) for name in data[METHOD].values]
    apart = disagreements(data)
    table = [
        [name, *(_number(value, ".1e") for value in row)]
        for name, row in zip(names, apart, strict=True)
    ]
    return ["method", *names], table


def left_out(data: Dataset, outcome: str) -> list[str]:
    """One sentence for each problem that a method cannot take, or was not given, with the reason.

    ``outcome`` is `UNFIT` or `NOT_COMPARED`.
    """
    found = {}
    for place in zip(*np.nonzero(data["outcome"].values == outcome), strict=True):
        problem, method, _ = cell_labels(data, place)
        found[problem, method] = f"{problem} by {method}: {data['message'].values[place]}"
    return list(found.values())


def alike_methods(data: Dataset) -> list[str]:
    """One sentence for each method whose single computation serves several accuracy levels."""
    found, here = [], tried(data)
    levels = data["accuracy"].values
    for i, j in np.ndindex(*data["outcome"].shape[:2]):
        served = np.where(here[i, j], data["served"].values[i, j], np.nan)[:, 0]
        for tolerance in dict.fromkeys(served[np.isfinite(served)].tolist()):
            same = levels[served == tolerance]
            if len(same) > 1:
                pair = f"{data['problem'].values[i]} by {data[METHOD].values[j]}"
                found.append(f"{pair}: one computation for {', '.join(map(str, same))}")
    return found


def tables(data: Dataset) -> dict[str, str]:
    """Every table of a dataset with verdicts, in Markdown, by file stem."""
    heads, failed = failures(data)
    notes = "".join(
        f"\n{outcome.capitalize()}: {text}\n"
        for outcome in (UNFIT, NOT_COMPARED)
        for text in left_out(data, outcome)
    )
    notes += "".join(f"\nAlike: {text}\n" for text in alike_methods(data))
    return {
        "means": _by_program(data),
        "failures": markdown_table(heads, failed) if failed else "Every cell is certified.\n",
        "agreement": _agreements(data),
        "comparison": markdown_table(HEADS, rows(data)) + notes,
    }


def _agreements(data: Dataset) -> str:
    """One table of agreement for each Program with an objective, at each accuracy level."""
    parts = []
    for program, one in groups(data):
        for k, level in enumerate(one["accuracy"].values):
            here = one.isel(accuracy=[k])
            if np.isfinite(here["objective"].values).any():
                table = markdown_table(*agreement(here))
                parts.append(f"{_caption(data, program)}At accuracy {level}:\n\n{table}")
    if not parts:
        return "No Program of this comparison has an objective.\n"
    said = "Largest difference of the objectives of valid answers, relative to their scale.\n\n"
    return said + "\n".join(parts)


def _by_program(data: Dataset) -> str:
    """One table of means for each Program, with an explanation of the means."""
    late = penalty(data)
    said = (
        "Times are shifted geometric means [s] of statement and solve, over the problems that a "
        f"method can take; a problem without a certificate counts {late:.4g} s, which is "
        + ("the time limit" if time_limit(data) else "the longest time of a cell")
        + ".\n\n"
    )
    return said + "\n".join(
        _caption(data, program) + markdown_table(*means(one, late)) for program, one in groups(data)
    )


def _caption(data: Dataset, program: str) -> str:
    """The Program's name, if there are several Programs."""
    return f"{program}\n\n" if len(set(per_problem(data, "program"))) > 1 else ""


def _spread(quartile: np.ndarray) -> str:
    """A median [s], with its quartiles if they differ."""
    low, middle, high = quartile
    text = _number(middle, ".4f")
    return text if not high > low else f"{text} ({low:.4f} to {high:.4f})"


def _number(value: float, form: str) -> str:
    return "-" if np.isnan(value) else format(value, form)
