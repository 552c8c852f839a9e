"""The head of a text table: names of the columns, and their units."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from workbench.errors import InputError
from workbench.identification.files.layouts import BLANKS, COMMENT_MARKS, Layout
from workbench.identification.files.units import is_unit, plain_unit

NO_NAMES = "no line names them"
BRACKETS = re.compile(r"[\[(].*[\])]")
FORMAT = re.compile(r"\[?[dhmsy]+([:/.\- T]+[dhmsy]+)+\]?", re.IGNORECASE)
"""A form of dates or clocks in a row of units, such as hh:mm:ss."""


@dataclass(frozen=True)
class Head:
    """Unique names of the columns; their units, if a row states them; and a description."""

    names: list[str]
    units: dict[str, str]
    said: str


def read_head(
    path: Path,
    layout: Layout,
    lines: Sequence[str],
    above: Sequence[int],
    first: int,
    used: int,
) -> Head:
    """The head of a table whose numbers begin in line ``first`` and fill ``used`` columns.

    Lines count from 0. The names are in the last line ``above`` the numbers, or above a row of
    units. If all lines above are comments, the last one names the columns if it has as many cells
    as the numbers.
    """
    commented = not above
    head = above or [i for i in range(first) if lines[i].strip()]

    def cells(i: int) -> list[str]:
        text = lines[i].strip().lstrip(COMMENT_MARKS + " ") if commented else lines[i]
        found = layout.cells(text)
        if len(found) != used and layout.separator == BLANKS:  # names may contain blanks
            wider = re.split(r"\t+|\s{2,}|[,;]\s*", text.strip())
            found = wider if len(wider) == used else found
        while len(found) > used and not found[-1]:
            found = found[:-1]
        return [cell.strip('"') for cell in found]

    plain = [str(j + 1) for j in range(used)]
    last = cells(head[-1]) if head else []
    more = last[used:] if layout.separator != BLANKS and not commented and all(last) else []
    last = last[: len(last) - len(more)]
    told = len(last) == used and any(last)
    if commented and (not told or any(map(layout.is_number, last))):
        return Head(plain, {}, NO_NAMES)
    if not told:
        if len(last) > 1:
            raise _too_few(path, head[-1], len(last), used, layout)
        return Head(plain, {}, NO_NAMES)
    wrong = [cell for cell in last if cell and not layout.is_number(cell)]
    if len(wrong) < len([cell for cell in last if cell]):
        raise InputError(
            f"{path}, line {head[-1] + 1}: {(wrong or last)[0]!r} is not a number: correct that "
            "cell, or the names if they are there"
        )
    before = cells(head[-2]) if len(head) > 1 else []
    if _names_above_units(before[:used], last):
        names = _unique_names(before[:used])
        pairs = zip(names, last, strict=True)
        units = {name: plain_unit(unit) for name, unit in pairs if not FORMAT.fullmatch(unit)}
        return Head(names, units, f"names in line {head[-2] + 1}, units below")
    said = f"names in line {head[-1] + 1}"
    said += f"; without entries: {', '.join(more)}" if more else ""
    return Head(_unique_names([cell or plain[j] for j, cell in enumerate(last)]), {}, said)


def _names_above_units(names: Sequence[str], units: Sequence[str]) -> bool:
    """Whether one line names columns and the next, with as many cells, holds only units."""
    return (
        len(names) == len(units)
        and all(names)
        and all(
            not unit or BRACKETS.fullmatch(unit) or FORMAT.fullmatch(unit) or is_unit(unit)
            for unit in units
        )
    )


def _unique_names(names: Sequence[str]) -> list[str]:
    """Names; those shared by several columns get a number, such as ``y[0]`` and ``y[1]``."""
    seen: dict[str, int] = {}
    found = []
    for name in names:
        place = seen.get(name, 0)
        seen[name] = place + 1
        found.append(f"{name}[{place}]" if names.count(name) > 1 else name)
    return found


def _too_few(path: Path, line: int, named: int, used: int, layout: Layout) -> InputError:
    if layout.separator == "," and used >= 2 * named - 1 > named:
        remedy = (
            "name every column in that line, or, if the numbers have decimal commas, separate "
            "columns by semicolons"
        )
    else:
        remedy = "name every column in that line, without blanks where blanks separate them"
    return InputError(f"{path}, line {line + 1} names {named} columns, {used} are needed: {remedy}")
