"""The readings under which most items are true at the same time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from .assignments import Assignment, assignments, natural, variables
from .items import Item
from .verdicts import Lookup, standings


class Together(NamedTuple):
    """Numbers of items that are true, and that are not, under one reading."""

    reading: dict[str, str]
    true: int
    false: int


class Varied(NamedTuple):
    """An item that was tried under several readings, with the variables that were varied for it."""

    names: tuple[str, ...]
    told: dict[tuple[str, ...], bool | None]

    def under(self, reading: Assignment) -> bool | None:
        """Whether the item is true under a reading; variables that no run varies keep their natural
        values.
        """
        return self.told.get(tuple(reading[name] for name in self.names))


def varied(item: Item, found: Lookup) -> Varied | None:
    """Truth of an item under the readings that were tried; None if there was only one."""
    usual = natural()
    known = [(own, one) for own, one in standings(item, found) if one is not None]
    names = tuple(
        name for name in usual if any(own.get(name, usual[name]) != usual[name] for own, _ in known)
    )
    if not names:
        return None
    told: dict[tuple[str, ...], bool | None] = {
        tuple(own[name] for name in names): one
        for own, one in known
        if all(own[name] == usual[name] for name in own if name not in names)
    }
    return Varied(names, told)


def together(items: Iterable[Item], found: Lookup) -> list[Together]:
    """Every reading with the items that are true under it, most of them first.

    Only items that were tried under several readings are counted; all others are the same in every
    row. Of equal readings, the one closest to the natural reading is first.
    """
    tried = [one for one in (varied(item, found) for item in items) if one is not None]
    usual = natural()
    rows = []
    for reading in assignments(variables()):
        told = [one.under(reading) for one in tried]
        rows.append(Together(reading, told.count(True), told.count(False)))

    def changed(row: Together) -> int:
        return sum(row.reading[name] != usual[name] for name in usual)

    return sorted(rows, key=lambda row: (-row.true, row.false, changed(row)))
