"""The page docs/thesis.md: the verdicts on the statements of the thesis."""

from __future__ import annotations

import tomllib
from itertools import islice

from workbench.study import markdown_table

from .assignments import TABLES, Assignment, changes, natural, variables
from .items import Found, Item, Number
from .numbers_page import Judged, counted, link, numbered, value
from .readings import Together, together
from .summaries import one_change
from .verdicts import Lookup, Verdict

INTRODUCTION = """\
This page lists the statements of E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003), item by item, in our words, and says of each whether it holds. The numbers come from the
committed reference results. No verdict is written by hand: it follows from the numbers by a rule.
The rule takes the first of these verdicts that applies."""
RULE = {
    Verdict.BUILT_IN: "the simulated laboratory has it as an input, so that finding it again "
    "proves nothing",
    Verdict.NOT_COMPUTABLE: "it cannot be computed; the table says what was tried",
    Verdict.NOT_EXPLAINED: "the thesis measured it, and our model does not show it",
    Verdict.REFUTED: "false under every reading; if it is simulated, outside a 99 % interval",
    Verdict.ALL: "true under every reading that can matter",
    Verdict.NATURAL: "true under the natural reading; other readings make it false, or were not "
    "run",
    Verdict.STATED: "true under another reading, or if its words mean what the table states",
    Verdict.OPEN: "not decided: something is missing, or a reading was not run",
}
"""Meaning of each verdict."""
READINGS = """\
The text of the thesis leaves some questions open. A reading is one choice for each of these
questions, and it holds for all items. The choices were fixed before the runs, with two exceptions:
the signal without delay was added after the runs had shown that its delay decides, and the fault
filter after one had been designed. The natural choice stands first. Simulations of defects have
hundreds of readings, of which only those were run that change one answer."""


def thesis(judged: Judged, found: Lookup) -> str:
    """The page about the thesis."""
    parts = [
        "# What the thesis says, and what became of it",
        " ".join(INTRODUCTION.split("\n")),
        _headline(judged, found),
        "The page is made by `make thesis`.",
        "## Ten findings",
        *_findings(judged),
        "## Readings",
        " ".join(READINGS.split("\n")),
        _questions(),
        *_together(judged, found),
    ]
    heads = ["numbers", "place", "the thesis says", "found", "verdict"]
    named = numbered(judged)
    for chapter, every in judged.items():
        rows = [
            [link(name), item.place, item.says, _words(item, found), str(one)]
            for name, item, one in islice(named, len(every))
        ]
        parts += [f"## {chapter}", markdown_table(heads, rows).rstrip()]
    return "\n\n".join(parts) + "\n"


def _headline(judged: Judged, found: Lookup) -> str:
    """Number of items with each verdict, and the verdict's meaning."""
    told = [one for every in judged.values() for _, one in every]
    lines = {one: f"- **{told.count(one)} {one}**: {words}." for one, words in RULE.items()}
    known = [
        counted(item, found, most=1)
        for every in judged.values()
        for item, one in every
        if one is Verdict.NATURAL
    ]
    stands = sum(one["true"] == sum(one.values()) for one in known)
    falls = sum(one["false"] > 0 for one in known)
    lines[Verdict.NATURAL] += (
        f" {stands} are true under every reading that changes one answer, and {falls} are false "
        "under one of these."
    )
    return "\n".join(lines.values())


def _findings(judged: Judged) -> list[str]:
    """The findings in plain words, each with the items on which it is based, and their verdicts."""
    rows = tomllib.loads((TABLES / "findings.toml").read_text(encoding="utf-8"))["finding"]
    found = {(item.place, item.says): (name, one) for name, item, one in numbered(judged)}
    lines = []
    for n, row in enumerate(rows, 1):
        rests = []
        for place, start in row["items"]:
            (key,) = (own for own in found if own[0] == place and own[1].startswith(start))
            name, verdict = found[key]
            rests.append(f"{link(name, place)}: {verdict}")
        lines.append(f"{n}. {row['words']} ({'; '.join(rests)})")
    return ["\n".join(lines)]


def _questions() -> str:
    """The variables with their values."""
    rows = [[one.question, "; ".join(one.values.values())] for one in variables().values()]
    return markdown_table(["question", "choices, the natural one first"], rows).rstrip()


def _together(judged: Judged, found: Lookup) -> list[str]:
    """The reading under which most items are true, compared with the natural one."""

    def combined(number: Number, reading: Assignment) -> Found | None:
        """A number, unless its problem was not run under every combination of answers."""
        return None if one_change(number.run) and changes(reading) else found(number, reading)

    rows = together((item for every in judged.values() for item, _ in every), combined)
    usual = next(row for row in rows if row.reading == natural())
    best = rows[0]
    count = usual.true + usual.false
    words = (
        f"{count} items were run under every combination of some answers. The natural reading "
        f"makes {usual.true} of them true. The reading that makes most of them true, {best.true}, "
        f"{_changes(best)}"
    )
    return [words]


def _changes(row: Together) -> str:
    """Where a reading is not the natural one, as a list."""
    changed = [
        f"- {one.question} Answer: {one.values[row.reading[name]]}."
        for name, one in variables().items()
        if row.reading[name] != one.natural
    ]
    if not changed:
        return "is the natural one."
    return "\n".join(["differs from the natural one by these answers:\n", *changed])


def _words(item: Item, found: Lookup) -> str:
    """A sentence about what was found; by default the first number that decides."""
    words = [
        one for one in (item.built_in, item.tried, item.reading, item.found, item.needs) if one
    ]
    if not words:
        number = next(one for one in item.numbers if one.decides)
        words = [f"{number.what}: {value(number, found)}"]
    return ". ".join(words)
