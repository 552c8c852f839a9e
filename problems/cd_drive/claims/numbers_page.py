"""The page docs/thesis-numbers.md: the numbers of each item, and the runs from which they come."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice

from workbench.study import markdown_table

from .assignments import Assignment, assignments, changes, natural, settable
from .items import Found, Item, Number, Quantity
from .summaries import Made
from .verdicts import Lookup, Verdict, standings, stands

Judged = Mapping[str, Sequence[tuple[Item, Verdict]]]
"""The items of each chapter, with their verdicts."""
Runs = Callable[[Number, Assignment], Made | None]
"""The run that shows a number under a reading; None if there is none."""
INTRODUCTION = """\
These are all numbers of the page [what the thesis says, and what became of it](thesis.md), item by
item. A number with limits decides about its item: the statement is true if the number lies within
the limits. Brackets contain the 99 % interval of a simulated number. The numbers are those of the
natural reading. Below them stand the runs on which the verdict rests, each with its key and the
command that makes it again: first those that give these numbers, then those that show other
[readings](thesis.md#readings)."""
TRUTH = {True: "true", False: "false", None: "not decided"}
COUNTED = {
    "false": "it is false under {}",
    "true": "it is true under {}",
    "not decided": "under {} a limit is within the interval of a number",
    "not run": "{} not run",
}
"""Readings of an item, counted."""


def numbered(judged: Judged) -> Iterator[tuple[str, Item, Verdict]]:
    """The items with their verdicts and names, such as 8-24 for the 24th of chapter 8."""
    for chapter, every in judged.items():
        start = chapter.removeprefix("Chapter ")[0]
        for n, (item, verdict) in enumerate(every, 1):
            yield f"{start}-{n}", item, verdict


def link(name: str, text: str = "") -> str:
    """A link to the section of an item, with its name as the text if none is given."""
    return f"[{text or name}](thesis-numbers.md#item-{name.lower()})"


def every_number(judged: Judged, found: Lookup, runs: Runs) -> str:
    """The page with every number and its run."""
    parts = ["# The numbers about the thesis", " ".join(INTRODUCTION.split("\n"))]
    named = numbered(judged)
    for chapter, every in judged.items():
        parts.append(f"## {chapter}")
        for name, item, one in islice(named, len(every)):
            parts += _section(name, item, one, found, runs)
    return "\n\n".join(parts) + "\n"


def _section(name: str, item: Item, verdict: Verdict, found: Lookup, runs: Runs) -> Iterator[str]:
    """An item: what it says, its numbers, and its runs."""
    yield f"### Item {name}"
    why = f" {_why(item, found)}" if verdict in (Verdict.OPEN, Verdict.NATURAL) else ""
    yield f"{item.place}: {item.says}. Verdict: **{verdict}**.{why}"
    if not item.numbers:
        yield "It has no numbers."
        return
    rows = [
        [number.what, value(number, found), _limits(number), f"`{number.run}`", _read(number)]
        for number in item.numbers
    ]
    yield markdown_table(["number", "found", "limits", "run", "metric"], rows).rstrip()
    if item.shown:
        yield f"Tables or figures that show it: {item.shown}."
    yield _runs(item, found, runs)


def _why(item: Item, found: Lookup) -> str:
    """What stands in the way of another verdict."""
    if item.needs:
        return f"{item.needs}."
    every = counted(item, found)
    one_answer = counted(item, found, most=1)
    words = f"Of {sum(every.values())} readings {_counts(every)}."
    if every["not run"] and every != one_answer:
        words += f" {sum(one_answer.values())} change at most one answer: {_counts(one_answer)}."
    taken = " Its words may be meant otherwise than they are taken here." if item.reading else ""
    return words + taken


def counted(item: Item, found: Lookup, most: int | None = None) -> dict[str, int]:
    """Numbers of the readings of an item by what is known of it; `most`: changes of an answer."""
    deciding = [number for number in item.numbers if number.decides]
    counts = dict.fromkeys(COUNTED, 0)
    for own, told in standings(item, found):
        if most is not None and changes(own) > most:
            continue
        missing = any(found(number, natural() | own) is None for number in deciding)
        counts["not run" if told is None and missing else TRUTH[told]] += 1
    return counts


def _counts(counts: Mapping[str, int]) -> str:
    """Numbers of readings as words."""
    return ", ".join(COUNTED[name].format(count) for name, count in counts.items() if count)


def _runs(item: Item, found: Lookup, runs: Runs) -> str:
    """The runs on which the verdict rests, each with a reading that it shows, the natural one
    first, and whether the item is true under this reading.
    """
    tried: list[tuple[Number, dict[str, str]]] = [(number, {}) for number in item.numbers]
    tried += [
        (number, own)
        for number in item.numbers
        if number.decides
        for own in assignments([*settable(number.run), *number.quantity.variables])
    ]
    rows: dict[tuple[str, ...], None] = {}
    for number, own in tried:
        reading = natural() | own
        run = runs(number, reading)
        if run is not None:
            told = TRUTH[stands(item, reading, found)]
            row = (f"`{_command(run)}`", f"`{run.key}`", _words(reading), told)
            rows[row] = None
    heads = ["made again by", "key", "reading", "the statement is"]
    return markdown_table(heads, list(rows)).rstrip()


def _words(reading: Assignment) -> str:
    """The answers by which a reading differs from the natural one."""
    usual = natural()
    changed = [f"{name} {one}" for name, one in reading.items() if one != usual[name]]
    return ", ".join(changed) or "natural"


def _command(run: Made) -> str:
    """The command that makes a run again."""
    settings = [f"--set {shlex.quote(f'{name}={one}')}" for name, one in run.parameters]
    return " ".join(["workbench run", run.problem, *settings])


def value(number: Number, found: Lookup) -> str:
    """A number under the natural reading."""
    one = found(number, natural())
    if one is None:
        return "not run"
    told = f"{one.value:.4g}"
    if _random(one):
        told += f" [{one.low:.3g}, {one.high:.3g}]"
    return told if number.printed is None else f"{told} (printed {number.printed:.4g})"


def _random(found: Found) -> bool:
    """Whether a number has an interval that can be computed."""
    return found.low < found.high and math.isfinite(found.low)


def _limits(number: Number) -> str:
    """Description of a number's limits."""
    if not number.decides:
        return "told beside"
    if number.low == number.high:
        return f"{number.low:.4g}"
    low = "" if number.low == -math.inf else f"at least {number.low:.4g}"
    high = "" if number.high == math.inf else f"at most {number.high:.4g}"
    return ", ".join(filter(None, [low, high]))


def _read(number: Number) -> str:
    """The metric of the run, or the function of metrics and arrays that gives the number."""
    quantity: Quantity = number.quantity.under(natural())
    if quantity.arguments is None:
        return f"`{quantity.name}`"
    told = ", ".join(f"{name}={one}" for name, one in quantity.arguments.items())
    return f"`{quantity.name}({told})`"
