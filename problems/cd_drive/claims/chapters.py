"""The items of each chapter, read from their tables."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from ..drive.tables import AXES
from .assignments import TABLES
from .items import Item, Number, Quantity

NAMES = (*(f"Chapter {n}" for n in range(1, 10)), "Appendix")
"""Names of the chapters."""


def file_of(chapter: str) -> str:
    """Name of a chapter's table."""
    return f"{chapter.lower().replace(' ', '_')}.toml"


@cache
def chapters() -> dict[str, tuple[Item, ...]]:
    """The items of each chapter."""
    return {name: tuple(_items(name)) for name in NAMES}


def items() -> Iterator[tuple[str, Item]]:
    """Every item with its chapter."""
    return ((chapter, item) for chapter, every in chapters().items() for item in every)


def numbers() -> Iterator[Number]:
    """The numbers of all items, in order."""
    return (number for _, item in items() for number in item.numbers)


def sources() -> list[str]:
    """Names of the problems from which numbers of the ledger come, in order."""
    return sorted({number.run for number in numbers()})


def _items(chapter: str) -> Iterator[Item]:
    table = tomllib.loads((TABLES / file_of(chapter)).read_text(encoding="utf-8"))
    for row in table["item"]:
        told = {name: one for name, one in row.items() if name != "number"}
        yield Item(
            numbers=tuple(one for number in row.get("number", ()) for one in _numbers(number)),
            **told,
        )


def _numbers(row: Mapping[str, Any]) -> Iterator[Number]:
    """The numbers of a row: one for each axis if its run names {axis}."""
    if "{axis}" not in row["run"]:
        yield _number(row)
        return
    for axis in AXES:
        arguments = {n: axis if v == "{axis}" else v for n, v in row.get("with", {}).items()}
        filled = {"what": f"{row['what']}, {axis}", "run": row["run"].format(axis=axis)}
        yield _number({**row, **filled, **({"with": arguments} if "with" in row else {})})


def _number(row: Mapping[str, Any]) -> Number:
    """A number of a row: a `metric`, or a function `read` with the arguments `with`."""
    if "metric" in row:
        quantity = Quantity(row["metric"])
    else:
        quantity = Quantity(row["read"], row.get("with", {}))
    low, high = row.get("at_least", -math.inf), row.get("at_most", math.inf)
    printed = row.get("printed")
    if "within" in row:
        off = row["within"] * abs(row["printed"])
        low, high = row["printed"] - off, row["printed"] + off
    exact, untouched = row.get("exact", False), tuple(row.get("untouched", ()))
    return Number(row["what"], row["run"], quantity, low, high, printed, exact, untouched)
