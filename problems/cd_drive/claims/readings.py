"""Which reading makes most items true together."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from .assignments import Assignment, assignments, natural, variables
from .items import Item
from .verdicts import Lookup, standings


class Together(NamedTuple):
    """How many items are true, and how many are not, under one reading."""

    reading: dict[str, str]
    true: int
    false: int


class Varied(NamedTuple):
    """An item that was tried under several readings: the variables that were varied for it."""

    names: tuple[str, ...]
    told: dict[tuple[str, ...], bool | None]

    def under(self, reading: Assignment) -> bool | None:
        """Whether the item is true under a reading; variables that no run varies stay natural."""
        return self.told.get(tuple(reading[name] for name in self.names))


def varied(item: Item, found: Lookup) -> Varied | None:
    """How an item stands under the readings that were tried; None where only one was."""
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

    Counted are items that were tried under several readings; all others stand as they do in every
    row. Of equal readings that which is nearest to the natural one stands first.
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
