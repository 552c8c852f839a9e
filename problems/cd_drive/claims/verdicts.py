"""The verdict on an item, by a fixed rule from its numbers under every reading."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import StrEnum

from .assignments import Assignment, assignments, natural, variables
from .items import Found, Item, Number

Lookup = Callable[[Number, Assignment], Found | None]
"""The number under a reading; None if no run shows it."""


class Verdict(StrEnum):
    """Verdict on a statement of the thesis, in the order in which the rule tries them."""

    BUILT_IN = "built in"
    NOT_COMPUTABLE = "not computable"
    NOT_EXPLAINED = "not explained by the model"
    REFUTED = "refuted"
    ALL = "reproduced under all readings"
    NATURAL = "reproduced under the natural reading"
    STATED = "reproduced under a stated reading"
    OPEN = "open"

    @property
    def reproduced(self) -> bool:
        """Whether the statement is true under some reading."""
        return self in (Verdict.ALL, Verdict.NATURAL, Verdict.STATED)


def depends_on(item: Item) -> tuple[str, ...]:
    """Variables that can change the numbers that decide about an item."""
    deciding = [number for number in item.numbers if number.decides]
    return tuple(name for name in variables() if any(one.depends_on(name) for one in deciding))


def stands(item: Item, reading: Assignment, found: Lookup) -> bool | None:
    """Whether an item is true under a complete reading; None if that is unknown."""
    judged = []
    for number in item.numbers:
        if number.decides:
            one = found(number, reading)
            judged.append(None if one is None else number.judge(one))
    return all_of(judged)


def all_of(judged: Iterable[bool | None]) -> bool | None:
    """False if any is false, else None if any is unknown or there is none, else True."""
    every = list(judged)
    if False in every:
        return False
    return None if not every or None in every else True


def standings(item: Item, found: Lookup) -> list[tuple[dict[str, str], bool | None]]:
    """Every reading that differs for an item, and whether the item is true; the natural one is
    first.
    """
    return [(own, stands(item, natural() | own, found)) for own in assignments(depends_on(item))]


def verdict(item: Item, found: Lookup) -> Verdict:
    """The verdict on an item.

    A statement that is true only if its words are taken in a stated way is at best reproduced under
    a stated reading, and is never refuted, since the words could be taken otherwise.
    """
    if item.built_in:
        return Verdict.BUILT_IN
    if item.tried:
        return Verdict.NOT_COMPUTABLE
    told = [one for _, one in standings(item, found)]
    if all(one is False for one in told):
        if item.measured:
            return Verdict.NOT_EXPLAINED
        return Verdict.OPEN if item.reading else Verdict.REFUTED
    if item.reading:
        return Verdict.STATED if True in told else Verdict.OPEN
    if all(one is True for one in told):
        return Verdict.ALL
    if told[0] is True:
        return Verdict.NATURAL
    return Verdict.STATED if True in told else Verdict.OPEN
